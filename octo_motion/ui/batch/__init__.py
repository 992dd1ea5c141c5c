# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: one file, or many shots from a job file."""
