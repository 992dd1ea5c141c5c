# SPDX-License-Identifier: GPL-3.0-or-later
"""What the hand feels: coupling, passivity, limits, and the loop that keeps time."""
