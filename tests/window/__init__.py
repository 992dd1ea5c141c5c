# SPDX-License-Identifier: GPL-3.0-or-later
"""The first hour in a real window: mouse and keys against the zip that artists install."""
