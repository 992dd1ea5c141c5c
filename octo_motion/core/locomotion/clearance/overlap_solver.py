# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms that would pass through each other or the body, moved aside over all frames at once.

Where capsules come too near to each other, the joints round them are asked to move apart: those
that are free to. What lies on the ground stays, and the other goes over it or round it. What is
asked is spread over the frames before and after, so that arms make room in time. Then segments
turn, as little and as evenly as it takes, and an arm that holds on is drawn back to where it does.
Rounds of that, each beginning where the one before has ended; of all rounds the one counts that
went best, for frames that have to do with each other. Arms that are still in each other after that
could not be parted, and move as if nobody had asked.

Where a constant says what was seen when it was other, that is the default octopus with the ten
set-ups on bumps of 0.3 arm lengths, arms overlapping by 0.02 to 0.07 radii; "jerk" as in
``ground/stance_swing``.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Final, Protocol

import numpy as np

from ...content_cache import part_of
from ...rotations import Floats
from ...rotations.components_first import dot
from ...smoothing import blur_reach, blurred, covered, smooth_step, widened
from ..ground import drawn
from ..rig import TOLERATED, lowest_allowed
from .capsule_overlap import Capsules, Crowd, Touches, Touching, all_of, aside, portions

_DAMPED: Final = 0.02
"""Stiffness of a segment, in squares of its length …"""
_EVEN: Final = 0.2
"""… and of each joint between two, likewise. At 0.1 arms that swap places on bumps turn by 27° in a
frame instead of 21°, and overlap by 1.1 radii instead of 0.2."""
_BOLD: Final = 0.5
"""Radians that a segment turns at most. At 1 Curl has a jerk of 0.077 instead of 0.067."""
_TINY: Final = 1e-12


def turned_towards(
    directions: Floats, lengths: Floats, *, free: Floats, goals: Floats, weights: Floats
) -> Floats:
    """Directions (chains, segments, 3) that bring joints nearer to where they are to go.

    They are unit vectors, or zero for segments of no length, which stay so; lengths are (chains,
    segments). Each segment is ``free`` to turn (chains, segments), 0…1; at 0 it stays as it is. The
    joint after it is to move by ``goals`` (chains, segments, 3), which matters by ``weights``
    (chains, segments).
    """
    count = lengths.shape[1]
    ease = np.sqrt(free)
    lever = lengths * ease
    # Turning a segment moves all joints that come after it. Sums over the joints after both of two
    # segments are those after the later one.
    beyond = _sums_beyond(weights)
    matrix = np.take(beyond, np.maximum.outer(np.arange(count), np.arange(count)), axis=1)
    matrix *= lever[:, :, None]
    matrix *= lever[:, None, :]
    # Of segments of no length, too, but little of that of the others.
    stiff = lengths**2 + _TINY * np.max(lengths**2, axis=1, keepdims=True)
    rows = np.arange(count)
    matrix[:, rows, rows] += _DAMPED * stiff
    between = _EVEN * np.sqrt(stiff[:, 1:] * stiff[:, :-1])
    matrix[:, rows[1:], rows[1:]] += between * free[:, 1:]
    matrix[:, rows[:-1], rows[:-1]] += between * free[:, :-1]
    mixed = between * ease[:, 1:] * ease[:, :-1]
    matrix[:, rows[1:], rows[:-1]] -= mixed
    matrix[:, rows[:-1], rows[1:]] -= mixed
    right = lever[..., None] * _sums_beyond(weights[..., None] * goals)
    turn = ease[..., None] * np.linalg.solve(matrix, right)
    turn -= np.einsum("isc,isc->is", turn, directions)[..., None] * directions
    most = _length(turn).max(axis=1)[:, None, None]
    result = directions + turn / np.sqrt(1.0 + (most / _BOLD) ** 2)
    turns = (free > 0.0) & (lengths > 0.0)
    return np.where(turns[..., None], unit(result), directions)


def _sums_beyond(values: Floats) -> Floats:
    """Sums (chains, segments, …) of values, each of its own segment and all after it."""
    result = values.copy()
    for segment in range(values.shape[1] - 2, -1, -1):
        result[:, segment] += result[:, segment + 1]
    return result


def joints_of(roots: Floats, directions: Floats, lengths: Floats) -> Floats:
    """Joints (chains, segments + 1, 3) of chains that begin at roots (chains, 3)."""
    chains, segments, _ = directions.shape
    result = np.empty((chains, segments + 1, 3))
    result[:, 0] = roots
    np.multiply(lengths[..., None], directions, out=result[:, 1:])
    for segment in range(segments):
        result[:, segment + 1] += result[:, segment]
    return result


_ROUNDS: Final = 28
"""With twelve, arms of Crawl on bumps go through each other by 1.5 radii instead of 0.05."""
_PATIENT: Final = 8
"""Rounds without any better one after which there is no hope. None of 88 walks over four grounds
comes out otherwise, and 64 arms that stand in one place take a third of the time."""
_BOLDLY: Final = 1.6
"""How much further arms are asked to go than they have to: they never get all the way. At 1.3 arms
of Hurry uphill overlap by 0.070 radii."""
_DONE: Final = 0.05
"""Share of the thinner radius: arms that overlap no deeper have made way."""
_AROUND: Final = 4
"""Reaches of the means, before and after arms touch, within which others may have to make way. Two
or eight change no figure by a tenth."""
_BRIEF: Final = 0.34
"""How much shorter than the rest the means are over which an arm becomes free when it lets go. At
0.68 arms of Hurry overlap by 0.054 radii instead of 0.045."""
_BORDER: Final = 1.6
"""Segments from where an arm lies over which it is less and less free to move. At 3.2 arms of Walk
overlap by 0.28 radii instead of 0.06."""
_RELUCTANT: Final = 3.0
"""How much less than in proportion what is hardly free gives way: it gives way against little
stiffness, and at 1 arms of the default walk would turn at once as they come to lie, by 15° in a
48th of a second instead of 11°. At 10 arms of Hurry uphill overlap the more."""
_AWAY: Final = 1.0
"""Radians that a segment may come away from where it was, for f / (1 - f) of 1, f its freedom."""
_STEADY: Final = 0.7
"""Share by which an arm in stance makes less way. At 0.35 arms of Hurry overlap by 0.060 radii
instead of 0.045."""
_PINNED: Final = 30.0
"""How much more the place where an arm holds on counts than that it makes way."""
_STEPS: Final = 4
"""Newton's steps that draw an arm back to where it holds on."""
_TORN: Final = 2e-5
"""Arm lengths by which an arm may miss that place; one that misses it more is left as it was."""
_SHALLOW: Final = 0.5
"""Share of the thinner radius up to which it does not matter that arms are as deep in each other as
they were."""
_TOO_MUCH: Final = (1.02, 1.05)
"""Shares of what is allowed, between which arms go back to as they were."""
_MOSTLY: Final = 0.5
"""Share of all frames from which on two capsules that overlap belong together."""
_REPEATS: Final = 3
"""How often arms that could not make way well are looked for."""
_ARMS_AT_ONCE: Final = 1024
"""Arms at some frame that are turned in one go …"""
_COLUMNS_AT_ONCE: Final = 32
"""… and joints whose ways are evened out over all frames in one go."""
_LITTLE: Final = 0.02
"""Share of a mean radius by which it begins gently to matter what is asked."""


class Floor(Protocol):
    """What arms must not be pushed into."""

    def clearance(self, frames: np.ndarray, points: Floats) -> Floats:
        """Height (items, joints) of points (items, joints, 3) above it at frames (items,)."""
        ...


def parting(
    crowd: Crowd,
    body: Sequence[Capsules],
    *,
    floor: Floor | None,
    width: int,
    most: float,
    nearest: bool = False,
    cyclic: bool = False,
) -> Generator[float, None, Floats | None]:
    """Joints (frames, arms, joints, 3) of arms that have made way; none if nobody has to. In steps
    that yield the share that is done.

    The result at a frame hangs on the frames within some reach of it, and on no state: the same
    motion gives the same result. Parts of the body have one frame, or one for each of the arms';
    ``width`` is that of the means over frames that make it smooth (``smoothing.blurred``); nobody
    makes way by turns of more than ``most`` radians in a frame, or than there were before. They go
    to the side on which they belong, or the ``nearest`` way. Cyclic, the last frame is the first
    again.
    """
    every = np.arange(len(crowd.joints))
    if not len(every):
        return None
    touching = Touching(crowd, body)
    yield 0.0
    touches = yield from touching.seeing()
    yield 0.0
    chosen = touches.depth > _DONE
    pairs, counts = np.unique(touches.pair[chosen], return_counts=True)
    # What overlaps nearly all the while is the creature's own form, and not in anybody's way.
    own_form = pairs[counts > _MOSTLY * len(every)]
    deep = np.zeros(len(every))
    deep[touches.frame[chosen & ~np.isin(touches.pair, own_form)]] = 1.0
    if not deep.any():
        return None
    # Who makes way may be in the way of others then, but not for ever.
    around = widened(deep, _AROUND * blur_reach(width), cyclic=cyclic) > 0.0
    yield 0.0
    yield from touching.looking_at(around, own_form)
    yield 0.0
    crowded = _Parting(
        *(crowd, touching, np.flatnonzero(around), floor),
        width=width,
        most=most,
        nearest=nearest,
        cyclic=cyclic,
    )
    yield 0.0
    return (yield from crowded.run())


@dataclass(frozen=True, eq=False)
class _Asked:
    """Capsules that are to part."""

    touches: Touches
    way: Floats
    """(3, touches) which way …"""
    far: Floats
    """(touches,) … and how far, as of ``aside``."""

    @classmethod
    def of(cls, touches: Touches, *, nearest: bool) -> _Asked:
        """Of some that are near to each other, those that have to, as of ``aside``."""
        way, far = aside(touches, nearest=nearest)
        chosen = np.flatnonzero(far > 1e-6 * touches.thin)
        return cls(part_of(touches, chosen), way[:, chosen], far[chosen])

    def where(self, chosen: np.ndarray) -> _Asked:
        """Of those (touches,), some."""
        some = np.flatnonzero(chosen)
        return _Asked(part_of(self.touches, some), self.way[:, some], self.far[some])


class _Best:
    """Of all rounds, for frames that have to do with each other, the one that went best."""

    def __init__(self, together: np.ndarray) -> None:
        self._together = together
        self._bad = np.full(int(together.max(initial=-1)) + 1, np.inf)
        self._done = np.zeros(len(self._bad), dtype=bool)
        self._idle = np.zeros(len(self._bad), dtype=np.intp)
        """Rounds since the best one."""
        self.directions = np.empty(0)

    def looked_at(self, directions: Floats, bad: Floats, done: np.ndarray) -> np.ndarray:
        """Which frames (frames,) have still something to do, and some hope, after a round with
        directions (frames, arms, segments, 3) that is so bad (frames,), and is done (frames,).
        """
        near = self._together >= 0
        labels = self._together[near]
        now = np.bincount(labels, bad[near], len(self._bad))
        left = np.bincount(labels, ~done[near], len(self._bad)) > 0.0
        better = (now < self._bad) & ~self._done
        if not self.directions.size:
            self.directions = directions.copy()
        own = near.copy()
        own[near] = better[labels]
        self.directions[own] = directions[own]
        self._bad = np.where(better, now, self._bad)
        self._idle = np.where(better, 0, self._idle + 1)
        self._done |= ~left | (self._idle >= _PATIENT)
        busy = near.copy()
        busy[near] = ~self._done[labels]
        return busy


def _together(around: np.ndarray, count: int, *, cyclic: bool) -> np.ndarray:
    """(frames,) numbers that are the same for frames, of those around (n,) others, which follow one
    another, and -1 for all others.
    """
    near = np.zeros(count, dtype=bool)
    near[around] = True
    result = np.where(near, np.cumsum(near & ~np.concatenate([[False], near[:-1]])) - 1, -1)
    if cyclic and near[0] and near[-1]:
        result[result == result[-1]] = 0
    return result


class _Parting:
    """One crowd, as it makes way."""

    def __init__(
        self,
        crowd: Crowd,
        touching: Touching,
        around: np.ndarray,
        floor: Floor | None,
        *,
        width: int,
        most: float,
        nearest: bool,
        cyclic: bool,
    ) -> None:
        self._crowd, self._touching, self._floor = crowd, touching, floor
        self._around, self._most = around, most
        self._ask = partial(_Asked.of, nearest=nearest)
        self._width, self._cyclic = width, cyclic
        self._joints = crowd.joints.copy()
        steps = np.diff(crowd.joints, axis=2)
        self._lengths = _length(steps)
        self._before = steps / np.maximum(self._lengths, _TINY)[..., None]
        self._directions = self._before.copy()
        self._length = float(self._lengths.sum(axis=2).mean())
        self._scale = float(crowd.radii.mean())
        self._depths_before = np.zeros(crowd.in_contact.shape[:2])
        lies = crowd.in_contact.any(axis=2)
        self._held = np.where(lies, 1.0, self._covered(lies.astype(np.float64), brief=True))
        self._anchor = _anchors(crowd.in_contact)
        self._free, self._loose = _freedom(crowd.in_contact)
        self._allowed, self._room = self._clearance()

    def run(self) -> Generator[float, None, Floats]:
        """Joints (frames, arms, joints, 3) after all rounds, in steps."""
        rounds = _ROUNDS + _REPEATS
        kept = self._crowd.kept[..., None]
        self._free = _in_time(self._free, kept, self._covered)
        yield 0.0
        self._loose = _in_time(self._loose, kept, self._covered)
        yield 0.0
        best: _Best | None = None
        for number in range(_ROUNDS + 1):
            asked = yield from self._asking(number / rounds)
            if best is None:
                self._depths_before = _depths(asked.touches, self._held.shape)
                best = _Best(_together(self._around, self._held.shape[0], cyclic=self._cyclic))
            yield number / rounds
            busy = best.looked_at(self._directions, *self._how_well(asked.touches))
            if number == _ROUNDS or not busy.any():
                break
            wanted = self._wanted(asked.where(busy[asked.touches.frame]))
            wanted[~busy] = 0.0
            yield number / rounds
            wanted = self._spread(wanted)
            yield number / rounds
            self._move(wanted)
            yield number / rounds
        assert best is not None
        self._put_back(best.directions)
        given_up = np.zeros(self._held.shape)
        for number in range(_ROUNDS, rounds):
            asked = yield from self._asking(number / rounds)
            deep = self._too_deep(asked.touches)
            yield number / rounds
            more = np.maximum(given_up, self._hopeless(deep))
            if np.array_equal(more, given_up):
                break
            given_up = more
            yield number / rounds
            self._give_up(np.minimum(self._covered(given_up), 1.0))
            yield number / rounds
        return self._joints

    def _how_well(self, touches: Touches) -> tuple[Floats, np.ndarray]:
        """How bad it is (frames,) that arms are in each other, as far as they would not have to go
        back for a jump; and at which frames (frames,) nobody has to make way any more.
        """
        depths = _depths(touches, self._held.shape)
        hopeless = self._hopeless(self._too_deep(touches))
        back = np.minimum(self._covered(hopeless), 1.0) * self._depths_before
        bad = np.maximum(np.maximum(depths, back) - _DONE, 0.0)
        sunk = self._room.min(axis=(1, 2)) < -1e-4 * self._length
        done = ~(depths > _DONE).any(axis=1) & ~sunk
        return (bad * bad).sum(axis=1), done

    def _put_back(self, directions: Floats) -> None:
        """Let arms have directions (frames, arms, segments, 3) that they had in some round."""
        chosen = np.nonzero(_differ(directions, self._directions))
        _in_pieces(lambda own: self._put(own, directions[own]), chosen)

    # --- What is known before anything moves ---

    def _covered(self, values: Floats, *, brief: bool = False) -> Floats:
        width = max(1, int(_BRIEF * self._width)) if brief else self._width
        return covered(values, width, cyclic=self._cyclic)

    def _clearance(self) -> tuple[Floats, Floats]:
        """How high above the floor joints (frames, arms, joints) have to stay, and are above that.

        Not lower than they are, or than their skin is thick.
        """
        shape = self._crowd.joints.shape[:3]
        allowed, room = np.full(shape, -np.inf), np.full(shape, np.inf)
        if self._floor is not None:
            frames = self._around
            points = self._crowd.joints[frames].reshape(-1, shape[2], 3)
            height = self._floor.clearance(np.repeat(frames, shape[1]), points)
            height = height.reshape(len(frames), *shape[1:])
            allowed[frames] = lowest_allowed(height, self._crowd.radii)
            room[frames] = height - allowed[frames]
        return allowed, room

    # --- One round ---

    def _asking(self, done: float) -> Generator[float, None, _Asked]:
        """Who is asked to make way where joints are now; all that overlap are. In steps."""
        for _ in self._touching.looking_again(self._joints):
            yield done
        found: list[_Asked] = []
        for each in self._touching.of_each(self._joints, self._ask):
            found.append(each)
            yield done
        return _Asked(
            all_of([each.touches for each in found]),
            np.concatenate([each.way for each in found], axis=1),
            np.concatenate([each.far for each in found]),
        )

    def _wanted(self, asked: _Asked) -> Floats:
        """By how much joints (frames, arms, joints, 3) would have to move at their own frame."""
        can = self._can(asked.touches, 0, asked.way), self._can(asked.touches, 1, -asked.way)
        wanted = _wishes(asked, can, self._joints.shape[:3], _LITTLE * self._scale)
        slack = 1e-9 * self._length
        if self._room.min() < -slack:
            where = np.nonzero(self._room < -slack)
            sunk, soft = -self._room[where] - slack, _LITTLE * self._scale
            sunk = np.where(sunk > soft, sunk, sunk * sunk / soft)
            wanted[where] += sunk[:, None] * self._crowd.up[where[0]]
        return wanted

    def _can(self, touches: Touches, which: int, way: Floats) -> Floats:
        """How far (touches,) the one or the other can make way, 0…1."""
        arm = touches.arms[which]
        own = arm < self._joints.shape[1]
        frame, arm = touches.frame, np.where(own, arm, 0)
        segment, share = np.where(own, touches.segments[which], 0), touches.shares[which]
        can = (1.0 - share) * self._loose[frame, arm, segment]
        can += share * self._loose[frame, arm, segment + 1]
        can *= 1.0 - _STEADY * self._held[frame, arm]
        # What is on the ground already is not pushed down.
        room = np.minimum(self._room[frame, arm, segment], self._room[frame, arm, segment + 1])
        radius = np.maximum(self._crowd.radii[arm, segment], _TINY)
        down = np.maximum(-dot(way, self._crowd.up[frame].T), 0.0)
        return own * can * (1.0 - down * (1.0 - smooth_step(room / (2.0 * radius))))

    def _spread(self, wanted: Floats) -> Floats:
        """The same, begun in time and ended late: as far as is asked, and smoothly."""
        result = np.zeros(wanted.shape)
        flat, spread = wanted.reshape(len(wanted), -1, 3), result.reshape(len(wanted), -1, 3)
        asked = (wanted.reshape(len(wanted), -1) != 0.0).any(axis=0)
        asked = np.flatnonzero(asked.reshape(-1, 3).any(axis=1))
        size = _length(flat[:, asked])
        some = size.max(axis=0, initial=0.0) > 1e-6 * self._scale
        columns, size = asked[some], size[:, some]
        for part in portions(len(columns), _COLUMNS_AT_ONCE):
            self._spread_some(columns[part], flat, size[:, part], spread)
        return result

    def _spread_some(
        self, columns: np.ndarray, wanted: Floats, size: Floats, spread: Floats
    ) -> None:
        """The same of some joints of arms (columns,), told by wanted (frames, arms · joints, 3) and
        its size (frames, columns).
        """
        # The way is told over as many frames as it is gone in: where one would be at an end before
        # the other, arms would set out with a jump.
        mean = blurred(wanted[:, columns], 2 * self._width, cyclic=self._cyclic)
        length = _length(mean)
        # Where it is asked to go now one way and now the other, it stays between them.
        mean_size = blurred(size, 2 * self._width, cyclic=self._cyclic)
        agreed = smooth_step(2.0 * length / np.maximum(mean_size, _TINY))
        whole = self._covered(size) * agreed
        whole[whole < 1e-5 * self._scale] = 0.0
        whole *= self._loose.reshape(len(wanted), -1)[:, columns]
        spread[:, columns] = (whole / np.maximum(length, _TINY))[..., None] * mean

    def _move(self, wanted: Floats) -> None:
        """Let joints move by what is wanted (frames, arms, joints, 3)."""
        _in_pieces(lambda own: self._turn(own, wanted[own]), np.nonzero(_differ(wanted, 0.0)))

    def _turn(self, chosen: tuple[np.ndarray, ...], wanted: Floats) -> None:
        """Turn the segments of arms at some frames (items,).

        Their joints are to move by what is wanted (items, joints, 3).
        """
        lengths, free = self._lengths[chosen], self._free[chosen]
        size = _length(wanted[:, 1:])
        joints = np.arange(1, lengths.shape[1] + 1)
        pinned = self._held[chosen][:, None] * (joints == self._anchor[chosen][:, None])
        weights = size / (size + 0.1 * self._scale) * (1.0 - pinned)
        # What is half held gives way half as far, and not as far as half that stiffness lets it.
        weights += pinned / (1.0 - pinned + 1.0 / _PINNED)
        directions = turned_towards(
            self._directions[chosen],
            lengths,
            free=free,
            goals=wanted[:, 1:] * (1.0 - pinned)[..., None],
            weights=weights,
        )
        directions = _within(self._before[chosen], directions, free)
        self._put(chosen, self._drawn_back(chosen, directions))

    def _drawn_back(self, chosen: tuple[np.ndarray, ...], directions: Floats) -> Floats:
        """Directions (items, segments, 3) of arms that hold on where they did.

        Just before and after, they are drawn there in part, so that letting go is no jump.
        """
        some = np.flatnonzero(self._held[chosen] > 0.0)
        if not len(some):
            return directions
        items = chosen[0][some], chosen[1][some]
        held, anchor, lengths = (
            self._held[items][:, None],
            self._anchor[items],
            self._lengths[items],
        )
        roots, rows = self._joints[items][:, 0], np.arange(len(some))
        moved = joints_of(roots, directions[some], lengths)[rows, anchor]
        goal = moved + held * (self._crowd.joints[items][rows, anchor] - moved)
        inside = np.arange(lengths.shape[1]) < anchor[:, None]
        back = drawn(
            np.ascontiguousarray(np.moveaxis(directions[some], 0, -1)),
            np.ascontiguousarray(lengths.T),
            free=np.ascontiguousarray(self._free[items].T),
            chosen=np.ascontiguousarray(inside.T.astype(np.float64)),
            roots=np.ascontiguousarray(roots.T),
            goal=np.ascontiguousarray(goal.T),
            steps=_STEPS,
        )
        back = np.moveaxis(back, -1, 0)
        missed = _length(joints_of(roots, back, lengths)[rows, anchor] - goal)
        torn = np.clip(missed / (_TORN * self._length) - 1.0, 0.0, 1.0)[:, None, None]
        back = np.where(torn > 0.0, back + torn * (self._before[items] - back), back)
        result = directions.copy()
        result[some] = unit(back)
        return result

    def _put(self, chosen: tuple[np.ndarray, ...], directions: Floats) -> None:
        self._directions[chosen] = directions
        joints = joints_of(self._joints[chosen][:, 0], directions, self._lengths[chosen])
        self._joints[chosen] = joints
        if self._floor is not None:
            self._room[chosen] = self._floor.clearance(chosen[0], joints) - self._allowed[chosen]

    def _too_deep(self, touches: Touches) -> Floats:
        """Which arms (frames, arms) are deeper in each other than they were, 0…1."""
        before = widened(self._depths_before, blur_reach(self._width), cyclic=self._cyclic)
        return _beyond(_depths(touches, self._held.shape) / np.maximum(before, _SHALLOW))

    def _hopeless(self, deep: Floats) -> Floats:
        """Which arms (frames, arms) could not make way, or not without a jump, 0…1, those too deep
        among them.
        """
        result, changed = deep.copy(), self._changed()
        most = max(float(self._turns_before.max(initial=0.0)), self._most)
        turns = self._turns_before.copy()
        # Between two frames of which neither has changed it turns as it did.
        anew = np.nonzero(changed[:-1] | changed[1:])
        turns[anew] = _turns(self._directions[:-1][anew], self._directions[1:][anew])
        swift = _beyond(turns / most)
        result[1:] = np.maximum(result[1:], swift)
        result[:-1] = np.maximum(result[:-1], swift)
        # By no more than they are too low: where that is a hair, they need not go back at once.
        sunk = -self._room.min(axis=2) / (TOLERATED * self._length)
        result = np.maximum(result, smooth_step(sunk - 1.0))
        return np.where(changed | (result < 1.0), result, 0.0)

    def _changed(self) -> np.ndarray:
        """Which arms (frames, arms) have made way."""
        return _differ(self._directions, self._before)

    @cached_property
    def _turns_before(self) -> Floats:
        """How far (frames − 1, arms) they turned before anything was moved."""
        return _turns(self._before[:-1], self._before[1:])

    def _give_up(self, share: Floats) -> None:
        """Let arms (frames, arms) move as they did before, by some share."""

        def give_up(chosen: tuple[np.ndarray, ...]) -> None:
            back = share[chosen][:, None, None]
            before, after = self._before[chosen], self._directions[chosen]
            mixed = unit(after + back * (before - after))
            mixed = np.where(back >= 1.0 - 1e-9, before, self._drawn_back(chosen, mixed))
            self._put(chosen, mixed)

        _in_pieces(give_up, np.nonzero((share > 1e-9) & self._changed()))


def _wishes(
    asked: _Asked, can: tuple[Floats, Floats], shape: tuple[int, ...], little: float
) -> Floats:
    """By how much joints (frames, arms, joints, 3), so many, would have to move for capsules to
    part which are asked to, and can (touches,) the one or the other: the mean of what is asked of
    each, by how far they are to go, where that is more than little.
    """
    touches, far, ways = asked.touches, asked.far, (asked.way, -asked.way)
    whole = can[0] + can[1] + _LITTLE
    places, weights, pushes = [], [], []
    for which in (0, 1):
        own = touches.arms[which] < shape[1]
        arm, share = touches.arms[which][own], touches.shares[which][own]
        push = ((_BOLDLY * far * can[which] / whole) * ways[which])[:, own]
        first = touches.frame[own] * shape[1] + arm
        first = first * shape[2] + touches.segments[which][own]
        for joint, part in ((0, 1.0 - share), (1, share)):
            places.append(first + joint)
            weights.append(far[own] * part)
            pushes.append(weights[-1] * push)
    place, weight = np.concatenate(places), np.concatenate(weights)
    size = int(np.prod(shape))
    whole = np.bincount(place, weight, size) + little
    wanted = np.empty((size, 3))
    for axis, each in enumerate(np.concatenate(pushes, axis=1)):
        wanted[:, axis] = np.bincount(place, each, size) / whole
    return wanted.reshape(*shape, 3)


def _depths(touches: Touches, shape: tuple[int, ...]) -> Floats:
    """How deep arms (frames, arms), so many, are in anything."""
    frames, arms = shape
    worst = np.zeros((frames, arms + int(touches.arms[1].max(initial=0)) + 1))
    for which in (0, 1):
        np.maximum.at(worst, (touches.frame, touches.arms[which]), touches.depth)
    return worst[:, :arms]


def _in_pieces(
    work: Callable[[tuple[np.ndarray, ...]], None], chosen: tuple[np.ndarray, ...]
) -> None:
    """Work on some arms (items,) and (items,) at their frames, so many at a time that all that is
    made of them stays in the cache.
    """
    for part in portions(len(chosen[0]), _ARMS_AT_ONCE):
        work(tuple(each[part] for each in chosen))


def _within(before: Floats, after: Floats, free: Floats) -> Floats:
    """Directions (…, segments, 3) that are as far from where they were as segments are free
    (…, segments), however often they are asked.

    Each round asks anew for what the ones before have not given: against that no stiffness lasts,
    and what is hardly free would come to turn as far as what is.
    """
    away = after - before
    allowed = _AWAY * free / np.maximum(1.0 - free, _TINY)
    share = 1.0 / np.sqrt(1.0 + (_length(away) / np.maximum(allowed, _TINY)) ** 2)
    return unit(before + share[..., None] * away)


def _beyond(shares: Floats) -> Floats:
    """How far (…) is to be taken back what is so much (…) of what is allowed, 0…1."""
    low, high = _TOO_MUCH
    return smooth_step((shares - low) / (high - low))


def _turns(first: Floats, second: Floats) -> Floats:
    """How far (…) a segment turns at most against the one before it, radians, from directions
    (…, segments, 3) at a frame to those at the next.
    """
    one, other = np.moveaxis(first, -1, 0), np.moveaxis(second, -1, 0)
    # The one before, turned the shortest way to where it is a frame later, takes the next along.
    (sx, sy, sz), (ex, ey, ez), (x, y, z) = one[..., :-1], other[..., :-1], one[..., 1:]
    ax, ay, az = sy * ez - sz * ey, sz * ex - sx * ez, sx * ey - sy * ex
    beyond = 1.0 / np.maximum(1.0 + sx * ex + sy * ey + sz * ez, 1e-6)
    cx, cy, cz = ay * z - az * y, az * x - ax * z, ax * y - ay * x
    taken = (
        x + cx + (ay * cz - az * cy) * beyond,
        y + cy + (az * cx - ax * cz) * beyond,
        z + cz + (ax * cy - ay * cx) * beyond,
    )
    left = [end - start for end, start in zip(other[..., 1:], taken, strict=True)]
    squares = left[0] * left[0] + left[1] * left[1] + left[2] * left[2]
    own = _length(second[..., 0, :] - first[..., 0, :])
    return np.maximum(own, np.sqrt(squares.max(axis=-1, initial=0.0)))


def _anchors(in_contact: np.ndarray) -> np.ndarray:
    """The first joint (frames, arms) that lies; of an arm that does not, the nearest in time."""
    lies = in_contact.any(axis=2)
    count, frames = len(lies), np.arange(len(lies))[:, None]
    last = np.maximum.accumulate(np.where(lies, frames, -count), axis=0)
    coming = np.minimum.accumulate(np.where(lies, frames, 2 * count)[::-1], axis=0)[::-1]
    closest = np.where(frames - last <= coming - frames, last, coming)
    return np.take_along_axis(in_contact.argmax(axis=2), np.clip(closest, 0, count - 1), axis=0)


def _freedom(in_contact: np.ndarray) -> tuple[Floats, Floats]:
    """How far segments (frames, arms, segments) and joints may move, 0…1."""
    numbers = np.arange(in_contact.shape[2])
    far = 10 * len(numbers)
    # Joints to the nearest one that lies, towards the tip and towards the root.
    onward = np.where(in_contact, numbers, far)[..., ::-1]
    onward = np.minimum.accumulate(onward, axis=2)[..., ::-1] - numbers
    back = numbers - np.maximum.accumulate(np.where(in_contact, numbers, -far), axis=2)
    segments = smooth_step(np.minimum(onward[..., :-1], back[..., 1:]) / _BORDER)
    # The root is the body's.
    return segments, smooth_step(np.minimum(np.minimum(onward, back), numbers) / _BORDER)


def _in_time(free: Floats, kept: np.ndarray, covered_by: Callable[..., Floats]) -> Floats:
    """Freedom (frames, arms, …) that comes and goes smoothly, and is nowhere more: none where arms
    are kept (frames, arms, 1) where they are.
    """
    bound = np.minimum(covered_by(np.where(kept, 1.0, 1.0 - free), brief=True), 1.0)
    left = (1.0 - bound) / (1.0 + (_RELUCTANT - 1.0) * bound)
    return np.where((free > 0.0) & ~kept, left, 0.0)


def _differ(one: Floats, other: Floats | float) -> np.ndarray:
    """Where (frames, arms) any of (frames, arms, …) is not the same."""
    # One axis is much quicker gone through than two.
    return (one != other).reshape(*one.shape[:2], -1).any(axis=2)


def _length(vectors: Floats) -> Floats:
    """Lengths (…) of vectors (…, 3)."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.sqrt(x * x + y * y + z * z)


def unit(vectors: Floats) -> Floats:
    """Vectors (…, 3) of length 1; those of none stay so."""
    return vectors / np.maximum(_length(vectors), _TINY)[..., None]
