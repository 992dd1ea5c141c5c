# SPDX-License-Identifier: GPL-3.0-or-later
"""Processes of ours that exchange messages."""

from .client import ALONE, Client, ClientState
from .process import ChannelClosedError, Child, MessageChannel, Parent, end_now

__all__ = [
    "ALONE",
    "ChannelClosedError",
    "Child",
    "Client",
    "ClientState",
    "MessageChannel",
    "Parent",
    "end_now",
]
