# SPDX-License-Identifier: GPL-3.0-or-later
"""Render farms that exist, with the job scripts that the extension has for them."""
