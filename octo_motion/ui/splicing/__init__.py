# SPDX-License-Identifier: GPL-3.0-or-later
"""Splicing: a body part of one clip put onto another."""
