# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole clip carried over to another body: all parts, the way through the world, feet that stand.

The parts are those of splicing, one after the other onto a body that does nothing: legs with the
pelvis's way, trunk, arms, head. What no part takes is as usual in a motion of that body. Each frame
hangs on the clip's own alone, but for feet that stand, whose frames before and behind have a say:
of a loop those are the rounds before and behind, so that it stays one.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from ...rotations import (
    Floats,
    from_matrix,
    multiply,
    rotate,
)
from ...smoothing import blurred
from ...steps import finished
from ..clip import (
    Clip,
    Reresting,
    posture_of,
    robust_places,
    robust_rotations,
    sample_clip,
    spread_clip,
)
from .foot_contacts import (
    FootContacts,
    FootPaths,
    Stance,
    find_contacts,
    find_stance,
    own_paths,
)
from .foot_lock import Footing, GroundHeight, locking_feet, steps_of
from .leg_travel import (
    BodyPath,
    body_path,
    check_hips,
    heading,
    leg_length,
    write_hips,
)
from .loop_rounds import Rounds, is_loop, own_round
from .parts import PARTS
from .rehung import Rehung, whole_limbs
from .retarget import (
    MappedClip,
    ReferredClip,
    Retarget,
    compared,
    find_retargets,
    writing_retargeted,
)
from .splice import LimbGoal
from .travel_lock import SIGHT, above_soles, answering_balls, size_ratio

_PARTS: Final = ("legs", "trunk", "left_arm", "right_arm", "head")
"""In the order in which they are put on: each hangs on those before it."""

_LOOKS: Final = 100
"""Moments of a body's own motion at which one sees how it holds what no part takes."""

_FOLLOWED: Final = 0.2
"""Seconds over which the body follows the ground, a third of it to either side."""

_LEVEL_LOOP: Final = 0.01
"""Leg lengths that ground rises at most from a loop's first frame to its last."""

_LEVEL: Final = np.array([1.0, 1.0, 0.0])


@dataclass(frozen=True)
class WholeBody:
    """How a whole clip is carried over."""

    goal: LimbGoal = "direction"
    """Hands in the direction where they were seen, or on the very point."""
    travel: bool = True
    """Whether the body goes through the world as the clip's does, at its own size; otherwise it
    stays where it begins."""
    foot_lock: bool = True
    """Whether feet stand where the clip's do."""
    ground: GroundHeight | None = None
    """What it stands on; none for the height at which the body stands anyway."""


def retarget_clip(
    base: MappedClip,
    still: Clip,
    source: MappedClip,
    settings: WholeBody | None = None,
) -> Clip:
    """What :func:`retargeting_clip` comes to."""
    return finished(retargeting_clip(base, still, source, settings))


def retargeting_clip(
    base: MappedClip,
    still: Clip,
    source: MappedClip,
    settings: WholeBody | None = None,
) -> Generator[None, None, Clip]:
    """A whole clip on another body, over all frames of a clip of that body that does nothing, in
    steps.

    Args:
        base: a clip of the body that gets it, by which the two are compared; it tells at which
            height it stands, and how it holds what no part takes.
        still: of its skeleton, at rest where nothing is carried over, as many frames as the source
            has; it says where its object stands, and at what frames the result is.
        source: the clip.
        settings: how, as usual if not given.

    Raises:
        ClipError: a landmark is missing, or the hips cannot leave their parent.
    """
    pair = yield from _pairing(base, still, source)
    return (yield from pair.moving(settings or WholeBody()))


class RetargetPreview:
    """A whole clip on another body at single frames, while it is set how: nearly so, as feet look
    no further than a little way to either side.

    Args as of :func:`retargeting_clip`.

    Raises:
        ClipError: a landmark is missing, or the hips cannot leave their parent.
    """

    def __init__(self, base: MappedClip, still: Clip, source: MappedClip) -> None:
        self._frames = still.frames
        self._pair = finished(_pairing(base, still, source))

    def whole(self, settings: WholeBody) -> Generator[None, None, Clip]:
        """All frames, exactly as :func:`retargeting_clip` has them, in steps."""
        return self._pair.moving(settings)

    def at(self, frame: float, settings: WholeBody) -> Clip:
        """The frame nearest to this one, in a clip that has no other.

        Raises:
            ClipError: the hips cannot leave their parent.
            GroundError: it leaves the ground.
        """
        row = int(np.abs(self._frames - frame).argmin())
        sight = round(SIGHT * self._pair.still.rate)
        first, last = max(row - sight, 0), min(row + sight, len(self._frames) - 1)
        rows = np.arange(first, last + 1)
        result = finished(self._pair.moving(settings, rows))
        return result.taken([row - first])


@dataclass(frozen=True, eq=False)
class _Pair:
    """Two bodies in the poses in which they are compared, and all that does not hang on how the one
    gets the other's clip.
    """

    base: MappedClip
    source: MappedClip
    retargets: list[Retarget]
    whole: MappedClip
    """The body with its limbs whole."""
    still: Clip
    """The body as it is, that does nothing, …"""
    joined: Clip
    """… with its limbs whole, …"""
    before: Clip
    """… and with its reference pose as its rest pose."""
    hung: Rehung | None
    rests: Reresting | None

    @cached_property
    def paths(self) -> FootPaths:
        """Where the clip's feet are."""
        return own_paths(self.source)

    @cached_property
    def balls(self) -> Floats:
        """Where the balls of the body's feet are; see :func:`answering_balls`."""
        return answering_balls(self.retargets[:2], "LR")

    @cached_property
    def stance(self) -> Stance:
        """How the body stands."""
        return find_stance(own_paths(self.whole, self.balls))

    def moving(
        self, settings: WholeBody, rows: np.ndarray | None = None
    ) -> Generator[None, None, Clip]:
        """The clip on the body, at all frames or at some of them (rows,), in steps."""

        def some(clip: Clip) -> Clip:
            return clip if rows is None else clip.taken(rows)

        mover = _Mover(self, settings, rows)
        yield
        result = yield from mover.onto(some(self.before))
        if self.rests is not None:
            result = self.rests.back(result, some(self.before), some(self.joined))
            yield
        if self.hung is not None:
            result = self.hung.back(result, some(self.joined), some(self.still))
        return result


def _pairing(base: MappedClip, still: Clip, source: MappedClip) -> Generator[None, None, _Pair]:
    assert len(still) == len(source.clip)
    still = _held_as_usual(still, base)
    whole, hung = whole_limbs(base)
    source, _ = whole_limbs(source)
    joined = still if hung is None else hung.into(still)
    yield
    ours, theirs = compared(whole, source)
    rests = ours.rests if isinstance(ours, ReferredClip) else None
    before = joined if rests is None else rests.into(joined)
    yield
    retargets: list[Retarget] = []
    for name in _PARTS:
        seen_from = "pelvis" if name == "legs" else ""
        retargets += find_retargets(PARTS[name], ours, theirs, clavicle=True, seen_from=seen_from)
        yield
    return _Pair(ours, theirs, retargets, whole, still, joined, before, hung, rests)


def _held_as_usual(still: Clip, own: MappedClip) -> Clip:
    """A body that does nothing, with bones on their parents as they usually are in a motion of its
    own: fingers round a grip, hair, what carries limbs. That is what becomes of those that no part
    takes, whatever its file's rest pose is. What carries the hips stays where it rests, turned as
    that motion begins.
    """
    skeleton, looks = still.skeleton, spread_clip(own.clip, _LOOKS)
    hips = own.bone("hips")
    above = skeleton.ancestors(hips)
    bones = [bone for bone in range(len(skeleton)) if bone not in (hips, *above)]
    rotations, locations = still.rotations.copy(), still.locations.copy()
    rotations[:, above] = looks.rotations[0, above]
    rotations[:, bones] = robust_rotations(looks.rotations[:, bones], np.ones((len(looks), 1)))
    locations[:, bones] = robust_places(looks.locations[:, bones])
    return replace(still, rotations=rotations, locations=locations)


class _Mover:
    """Puts a whole clip, or some rows of it, onto a body."""

    def __init__(self, pair: _Pair, settings: WholeBody, rows: np.ndarray | None) -> None:
        base, source, retargets = pair.base, pair.source, pair.retargets
        self._base, self._source, self._rows = base, source, rows
        self._retargets = retargets
        self._settings = settings
        self._ratio = size_ratio(retargets[0])
        self._still = pair.before
        frames = source.clip.frames
        self._frames = frames if rows is None else frames[rows]
        self._moment = sample_clip(source.clip, self._frames)
        self._paths, self._balls, self._stands = pair.paths, pair.balls, pair.stance
        if settings.ground is not None:
            self._stands = above_soles(self._stands, base)
        self._width = max(1, round(_FOLLOWED * source.clip.rate))
        check_hips(base.skeleton, retargets[0].frames[0].bone)

    def onto(self, before: Clip) -> Generator[None, None, Clip]:
        """The whole, on frames of a body that does nothing, in steps."""
        rotations, locations = before.rotations.copy(), before.locations.copy()
        skeleton = before.skeleton
        exact = self._settings.goal == "exact"
        for number, each in enumerate(self._retargets):
            posture = posture_of(skeleton, rotations, locations)
            reaches = exact and each.limb is not None
            yield from writing_retargeted(
                each, posture, self._moment, rotations, locations, exact=reaches
            )
            yield
            if number == 1:
                # Both legs are on: what follows hangs on the pelvis.
                self._travel(before, rotations, locations)
                yield
        result = replace(before, rotations=rotations, locations=locations)
        if not (self._settings.travel and self._settings.foot_lock):
            return result
        return (yield from self._standing(result))

    def _travel(self, before: Clip, rotations: Floats, locations: Floats) -> None:
        """The pelvis's way, at the body's own size, from where its object stands."""
        ours, theirs = self._retargets[0].frames
        clip = self._source.clip
        path = body_path(clip, theirs, self._moment, self._frames)
        turn = heading(_object_turn(self._still), _object_turn(clip))
        start = self._still.world[0, :3, 3] * _LEVEL
        way = path.places - clip.world[0, :3, 3] * _LEVEL
        if not self._settings.travel:
            way = np.where(_LEVEL > 0.0, 0.0, way)
        places = start + self._ratio * rotate(turn, way * _LEVEL)
        rise = path.places[:, 2] - find_stance(self._paths).ankle
        places[:, 2] = self._ground(places) + self._ratio * rise
        goal = BodyPath(multiply(turn, path.orientations), places)
        write_hips(
            before,
            ours,
            posture_of(before.skeleton, rotations, locations),
            goal,
            (rotations, locations),
        )

    def _ground(self, places: Floats) -> Floats:
        """(frames,) height of the ankles of somebody who stands there."""
        ground = self._settings.ground
        if ground is None:
            return np.full(len(places), self._stands.ankle)
        return self._stands.ankle + blurred(ground.height(places), self._width)

    def _standing(self, result: Clip) -> Generator[None, None, Clip]:
        """With feet that stand, in steps."""
        paths, ground = self._paths, self._settings.ground
        loops = is_loop(self._source, paths)
        if loops and ground is not None:
            # Uphill no round is like the one before.
            _, heads = result.taken([0, -1]).posed()
            rise = np.ptp(ground.height(heads[:, self._base.bone("hips")]))
            loops = bool(rise < _LEVEL_LOOP * leg_length(self._base) * result.scale)
        if loops:
            paths = replace(paths, points=Rounds.between(paths.hips).points(paths.points))
        contacts = find_contacts(paths)
        yield
        steps = steps_of(paths, contacts, find_stance(paths), self._ratio)
        yield
        if self._rows is not None:
            own = own_round(len(paths.moments)) if loops else slice(None)
            contacts, steps, loops = FootContacts(contacts.held[own]), steps[own], False
        footing = Footing(
            contacts,
            paths.moments,
            self._stands,
            steps,
            self._frames,
            ground,
            self._balls,
            cyclic=loops,
        )
        return (yield from locking_feet(self._base, result, footing))


def _object_turn(clip: Clip) -> Floats:
    return from_matrix(clip.world[0, :3, :3] / clip.scale)
