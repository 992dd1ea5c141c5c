# SPDX-License-Identifier: GPL-3.0-or-later
"""How an octopus reaches: a bend that travels along the arm from its base to its tip.

Gutfreund, Flash, Yarom, Fiorito, Segev and Hochner, "Organization of octopus arm movements: a
model system for studying the control of flexible arms" (Journal of Neuroscience 16, 1996), found
that an octopus reaches by pushing a bend along its arm: what lies before the bend is straight and
points at the target, what lies behind follows it curled; the bend's speed has one peak between
start and end, and the movement stays near a plane. Here the bend's place along the arm runs as a
hand's does in a reach of least jerk (Flash and Hogan 1985), ``10 t³ − 15 t⁴ + 6 t⁵``, whose speed
is such a bell. What lies behind the bend is a logarithmic spiral: its radius is in proportion to
what is left of the arm, so it does not run into itself. Suckers face outwards there, and lead at
the bend, as they do in nature.

After the touch the same front runs on to the tip, and the arm winds about the object as it passes.
An arm that only curls up has the same spiral, which forms at its tip.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...errors import SettingsError
from ...rotations import Floats, lerp_rotation_vectors
from ...smoothing import least_jerk
from ..rig import ArmFrames, bend_rotations

FOLD: Final = np.radians(100.0)
"""Angle of the travelling bend."""
_SPIRAL: Final = 1.2
"""Radians of the spiral for each time that what is left of the arm gets e times shorter."""
_BLUNT: Final = 0.2
"""Arm lengths that the spiral thinks are left at the tip, so that it is not wound up endlessly."""
_SHY: Final = 0.2
"""Share of bend and spiral while the bend is at the root: an arm that folds back there would lie
over the head."""
_BOLD: Final = 0.6
"""Where along the arm, in its lengths, the bend has its full angle."""
_MOST_BENT: Final = np.radians(75.0)
"""Of one joint."""
_FRONT: Final = 0.26
"""Width of the front in arm lengths."""
_FRONT_SEGMENTS: Final = 2.0
"""Least width of the front in segments."""
_FIRST_BEND: Final = 0.1
"""Where the bend forms, in arm lengths from the root."""
_GATHERED: Final = 0.5
"""Share of the reach by which the arm has left what it did otherwise."""
_SET_OUT: Final = 0.12
"""Share of the reach after which the bend sets out."""
_STAGGER: Final = 0.8
"""How much later the root joins in than the tip, in times that each of them takes."""
_UNWOUND: Final = 0.5
"""Share of the return by which the arm has let go."""
_BACK_FROM, _BACK_TO = 0.25, 0.9
"""Shares of the return between which the bend runs back to the root."""
_LEAVES: Final = 0.45
"""Share of the return after which the arm begins to go back to what it does otherwise."""


@dataclass(frozen=True)
class Timeline:
    """When an arm does what, in frames."""

    start: float
    """It sets out."""
    contact: float
    """It touches."""
    closed: float
    """It is wound all the way."""
    release: float
    """It begins to let go."""
    end: float
    """It does what it would do otherwise."""

    def __post_init__(self) -> None:
        times = (self.start, self.contact, self.closed, self.release, self.end)
        if not np.all(np.isfinite(times)):
            raise SettingsError("A time of the reach is not a number.", "Set it anew.")
        if not self.start < self.contact <= self.closed <= self.release < self.end:
            raise SettingsError(
                f"A reach that starts at frame {self.start:g}, touches at {self.contact:g}, holds "
                f"from {self.closed:g} to {self.release:g} and ends at {self.end:g} is out of "
                "order.",
                "Let each come after the one before.",
            )

    def weight(self, times: Floats, along: Floats) -> Floats:
        """How far (frames, joints) the arm has left what it does otherwise, 0…1, of joints along it
        (joints,), 0…1.

        The tip curls up before the root aims, and stretches out after the root has gone back: so
        the arm does not sweep over what it reaches for.
        """
        whole, back = self.contact - self.start, self.end - self.release
        out = (times[:, None] - self.start) / (_GATHERED * whole)
        gone = (times[:, None] - self.release - _LEAVES * back) / ((1.0 - _LEAVES) * back)
        out = least_jerk((1.0 + _STAGGER) * out - _STAGGER * (1.0 - along))
        gone = least_jerk((1.0 + _STAGGER) * gone - _STAGGER * along)
        return out * (1.0 - gone)

    def front(self, times: Floats, begins: float, touches: float, ends: float) -> Floats:
        """Where (frames,) the front is along the arm, from its three places."""
        whole, back = self.contact - self.start, self.end - self.release
        out = least_jerk((times - self.start - _SET_OUT * whole) / ((1.0 - _SET_OUT) * whole))
        if self.closed > self.contact:
            wound = least_jerk((times - self.contact) / (self.closed - self.contact))
        else:
            wound = (times >= self.contact).astype(np.float64)
        unwound = least_jerk((times - self.release) / (_UNWOUND * back))
        back_again = least_jerk(
            ((times - self.release) / back - _BACK_FROM) / (_BACK_TO - _BACK_FROM)
        )
        place = begins + (touches - begins) * out * (1.0 - back_again)
        return place + (ends - touches) * wound * (1.0 - unwound)


def front_width(lengths: Floats) -> float:
    """Over how long a stretch of the arm the front passes."""
    return max(_FRONT * float(lengths.sum()), _FRONT_SEGMENTS * float(lengths.mean()))


def first_place(lengths: Floats) -> float:
    """Where the front is when the bend forms."""
    return _FIRST_BEND * float(lengths.sum())


def passed(lengths: Floats, front: Floats) -> Floats:
    """How far (…, segments) the front (…) has passed the joint at each segment's root, 0…1.

    The first joint aims the arm; it is always passed.
    """
    joints = np.cumsum(lengths) - lengths
    result = least_jerk((front[..., None] - joints) / front_width(lengths))
    result[..., 0] = 1.0
    return result


def folded(lengths: Floats, front: Floats, *, bend: float = 1.0, curl: float = 1.0) -> Floats:
    """Turns (…, segments, 4) of what the front (…), a place along the arm, has not passed: so much
    of the bend, and of the spiral beyond it.
    """
    whole, width = float(lengths.sum()), front_width(lengths)
    shy = _SHY + (1.0 - _SHY) * least_jerk(front[..., None] / (_BOLD * whole))
    shy = np.where(front[..., None] < 0.0, 1.0, shy)
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    left = whole - ends + _BLUNT * whole
    spiral = curl * _SPIRAL * np.log(left[:-1] / left[1:])
    # The bend lies within the front: its angle up to each place along the arm runs as the front.
    behind = front[..., None] - 0.5 * width
    so_far = least_jerk((ends - 0.5 * np.append(lengths, lengths[-1]) - behind) / width)
    fold = bend * FOLD * np.diff(so_far, axis=-1)
    angles = np.minimum(shy * (spiral + fold), _MOST_BENT)
    angles[..., 0] = 0.0
    return bend_rotations(angles)


# --- An arm that curls up from its tip, and stretches again ---------------------------------------


_FREE: Final = 0.3
"""Share of the arm, from its root, that hardly curls."""
_TIGHT: Final = 3.1
"""How much tighter than that of a reach the spiral is."""
_WAVE: Final = 0.5
"""How much of the time the curl needs to run along the arm."""


def curled(arm: ArmFrames, timeline: Timeline, times: Floats, otherwise: Floats) -> Floats:
    """Rotations (frames, bones, 4) of an arm that curls up until it "touches", in arm lengths.

    A spiral forms at the tip and runs towards the root; letting go, the root is first to stretch.
    Of the timeline ``start``, ``contact``, ``release`` and ``end`` count.
    """
    along = arm.reach[:-1] / arm.length
    up = (times[:, None] - timeline.start) / (timeline.contact - timeline.start)
    down = (times[:, None] - timeline.release) / (timeline.end - timeline.release)
    up = least_jerk((up - _WAVE * (1.0 - along)) / (1.0 - _WAVE))
    down = least_jerk((down - _WAVE * along) / (1.0 - _WAVE))
    share = up * (1.0 - down) * least_jerk(along / _FREE)
    usual = arm.shape(arm.from_bones(otherwise))
    # A front before the arm's root: all of it is behind.
    spiral = folded(arm.lengths, np.full(len(times), -arm.length), bend=0.0, curl=_TIGHT)
    spiral[:, 0] = usual[:, 0]
    shape = arm.shaped(lerp_rotation_vectors(usual, spiral, share))
    result = otherwise.copy()
    moves = np.any(share > 0.0, axis=-1)
    result[moves] = arm.to_bones(shape)[moves]
    return result
