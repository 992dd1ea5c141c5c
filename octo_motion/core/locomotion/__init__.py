# SPDX-License-Identifier: GPL-3.0-or-later
"""An armed body walks and swims along a route (after Ishizuka 2008)."""
