# SPDX-License-Identifier: GPL-3.0-or-later
"""Posing: a character as a jointed puppet with plastic joints."""
