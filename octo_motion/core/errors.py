# SPDX-License-Identifier: GPL-3.0-or-later
"""The errors that a user can meet: what is wrong, and what to do about it."""

from __future__ import annotations

from .phrases import as_phrase, joined_phrases


class OctoMotionError(Exception):
    """Something the user can put right.

    ``problem`` says in one sentence what is wrong, ``remedy`` what to do; both start with a
    capital letter and end with a full stop. The user interface shows them together.
    """

    def __init__(self, problem: str, remedy: str = "") -> None:
        self.problem = as_phrase(problem)
        self.remedy = as_phrase(remedy)
        super().__init__(joined_phrases(" ", (self.problem, self.remedy)))


class RigError(OctoMotionError):
    """The armature, or its list of arms, cannot be used as it is."""


class GaitError(OctoMotionError):
    """A gait table is damaged or incomplete."""


class RouteError(OctoMotionError):
    """The route cannot be followed."""


class GroundError(OctoMotionError):
    """The ground cannot be walked on."""


class SettingsError(OctoMotionError):
    """A setting has a value that makes no sense, alone or with others."""


class WriteError(OctoMotionError):
    """The result has nowhere to go: read-only data, a missing folder, a full disk."""


class ClipError(OctoMotionError):
    """A motion clip cannot be read, or has not what splicing needs of it."""


class DeviceError(OctoMotionError):
    """A six-degree-of-freedom device, or the program that drives it, cannot be used."""
