# SPDX-License-Identifier: GPL-3.0-or-later
"""How far arms pass through each other and through the body, over all frames at once.

Arms are chains of capsules: a bone's length, with the skin's radius at its two ends. First spheres
round the capsules tell which can touch at all; only these are measured, by the nearest points of
two line segments (Ericson, Real-Time Collision Detection, 2005, 5.1.9). Capsules that overlap at
rest are built so: at the crown, where arms stand side by side, there is nothing to report. Nor is
there of those next to them that have less than their own thickness between them: where arms spring
from one place, no pose can keep these apart.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any, Final, TypeVar

import numpy as np

from ...content_cache import part_of
from ...rotations import Floats
from ...rotations.components_first import dot
from ...smoothing import smooth_step
from ...steps import finished

_Made = TypeVar("_Made")

_NO_LENGTH: Final = 1e-30
"""Squares of lengths that are none, however small a rig's unit makes its bones."""
_BARE: Final = 1e-4
"""Share of the other one's radius up to which a capsule has no skin there."""
_PARALLEL: Final = 1e-10
"""Square of the sine of the angle between two segments that are as good as parallel."""
_AT_ONCE: Final = 500_000
"""Distances that are looked at in one go: what the processor keeps at hand."""
_ROWS_AT_ONCE: Final = 8_000
"""Pairs of capsules of which all is worked out in one go, likewise."""
_FOR_ONE_THREAD: Final = 100_000
"""Multiplications of a product of matrices for which numpy's linear algebra wakes no threads:
beside other programs these wait for each other a hundred times as long as the product takes."""
_ROUNDED: Final = 1e-4
"""Share of a distance in single precision by which it may be wrong."""
_BUILT_SO: Final = 0.02
"""Share of the smaller radius by which capsules may overlap at rest and still count."""
_CROWDED: Final = 1.0
"""The same by which capsules are apart at rest that are still crowded, next to such as overlap."""


@dataclass(frozen=True, eq=False)
class Capsules:
    """A chain of capsules over time: an arm, or a part of the body."""

    name: str
    joints: Floats
    """(frames, joints, 3), at least two joints."""
    radii: Floats
    """(joints,)"""
    at_rest: Floats
    """(joints, 3) the same joints at rest, all chains in one space."""


@dataclass(frozen=True)
class Overlap:
    """The deepest overlap of one pair of chains."""

    first: str
    second: str
    frame: int
    """Number of the frame in the arrays, not of the scene."""
    depth: float
    """Share of the smaller radius there."""


@dataclass(frozen=True, eq=False)
class Separation:
    """What :func:`measure_overlap` finds."""

    depths: Floats
    """(frames,) deepest overlap at each frame, as a share of the smaller radius; 0 for none."""
    overlaps: tuple[Overlap, ...]
    """Of each pair of chains that overlap anywhere, deepest first."""

    @property
    def worst(self) -> Overlap | None:
        """The deepest of all."""
        return self.overlaps[0] if self.overlaps else None


def measure_overlap(chains: Sequence[Capsules], body: Sequence[Capsules] = ()) -> Separation:
    """How far chains pass through each other, as :func:`measuring_overlap` finds."""
    return finished(measuring_overlap(chains, body))


def measuring_overlap(
    chains: Sequence[Capsules], body: Sequence[Capsules] = ()
) -> Generator[None, None, Separation]:
    """How far chains, the arms, pass through each other and through parts of the body; in steps.

    Neighbouring capsules of one chain are joined; a chain is not measured against itself, nor parts
    against each other.
    """
    every = [*chains, *body]
    if not chains:
        return Separation(np.zeros(0), ())
    parts = parts_of(every)
    pairs = pairs_of(every, len(chains))

    def overlapping(found: Near) -> tuple[np.ndarray, ...]:
        depths = _depths(parts, (found.frame, found.one, found.other))
        deep = depths > 0.0
        return found.frame[deep], found.one[deep], found.other[deep], depths[deep]

    depths = np.zeros(parts.starts.shape[1])
    found: list[tuple[np.ndarray, ...]] = []
    for each in near(Middles.of(parts), pairs, overlapping):
        found.append(each)
        yield
    number, one, other, deep = joined(found, (np.intp, np.intp, np.intp, np.float64))
    np.maximum.at(depths, number, deep)
    owner = parts.owner
    return Separation(depths, _pairs(every, owner[one], owner[other], number, deep))


@dataclass(frozen=True, eq=False)
class Parts:
    """The capsules of all chains, one after the other."""

    starts: Floats
    """(3, frames, capsules)"""
    ends: Floats
    """(3, frames, capsules)"""
    radii: tuple[Floats, Floats]
    """(capsules,) at starts and at ends."""
    owner: np.ndarray
    """(capsules,) number of each one's chain."""


def parts_of(chains: Sequence[Capsules]) -> Parts:
    """The capsules of chains that all have as many frames."""
    owner = np.repeat(np.arange(len(chains)), [len(each.radii) - 1 for each in chains])
    ends = np.empty((2, 3, len(chains[0].joints), len(owner)))
    done = 0
    for each in chains:
        joints = np.moveaxis(each.joints, -1, 0)
        own = slice(done, done + joints.shape[2] - 1)
        ends[0, ..., own], ends[1, ..., own] = joints[..., :-1], joints[..., 1:]
        done = own.stop
    return Parts(
        ends[0],
        ends[1],
        (
            np.concatenate([each.radii[:-1] for each in chains]),
            np.concatenate([each.radii[1:] for each in chains]),
        ),
        owner,
    )


def pairs_of(chains: Sequence[Capsules], moving: int) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (pairs,) and (pairs,) of the capsules that must not overlap.

    They are of two chains, of which one at least moves (those come first), and are apart at rest,
    and no longer crowded there.
    """
    rest = [Capsules(each.name, each.at_rest[None], each.radii, each.at_rest) for each in chains]
    parts = parts_of(rest)
    one, other = np.triu_indices(len(parts.owner), 1)
    asked = (parts.owner[one] != parts.owner[other]) & (parts.owner[one] < moving)
    one, other = one[asked], other[asked]
    depths = _depths(parts, (np.zeros_like(one), one, other))
    built = np.zeros((len(parts.owner), len(parts.owner)), dtype=bool)
    built[one, other] = depths > _BUILT_SO
    built |= built.T
    # The capsule before each in its chain; of a chain's first that is itself.
    before = np.maximum(np.arange(len(parts.owner)) - 1, 0)
    before = np.where(parts.owner[before] == parts.owner, before, np.arange(len(before)))
    joined = built[before[one], other] | built[one, before[other]]
    joined |= built[before[one], before[other]]
    apart = ~built[one, other] & ~(joined & (depths > -_CROWDED))
    return one[apart], other[apart]


@dataclass(frozen=True, eq=False)
class Middles:
    """Where the capsules of all chains are, roughly."""

    places: np.ndarray
    """(frames, capsules, 3) their middles, single precision, around that of all."""
    squares: np.ndarray
    """(frames, capsules) of how far away from there that is, likewise."""
    reach: Floats
    """(capsules,) half of the length that each has at most."""
    wide: Floats
    """(capsules,) their larger radius."""
    owner: np.ndarray
    """(capsules,) number of each one's chain; chains come one after the other."""

    @classmethod
    def of(cls, parts: Parts) -> Middles:
        """Of capsules at all frames."""
        places = np.empty((*parts.starts.shape[1:], 3), dtype=np.float32)
        whole = np.zeros(parts.starts.shape[1:])
        for axis, (start, end) in enumerate(zip(parts.starts, parts.ends, strict=True)):
            middle = 0.5 * (start + end)
            # Around its middle a scene's rounding in single precision is least.
            places[..., axis] = middle - middle.mean()
            whole += (end - start) ** 2
        squares = np.einsum("fsi,fsi->fs", places, places)
        reach = 0.5 * np.sqrt(whole.max(axis=0))
        return cls(places, squares, reach, np.maximum(*parts.radii), parts.owner)


@dataclass(frozen=True, eq=False)
class Near:
    """Capsules whose bounding spheres touch."""

    frame: np.ndarray
    """(n,) numbers of frames …"""
    one: np.ndarray
    """… of capsules …"""
    other: np.ndarray
    """… and of others, which come after them."""
    least: Floats
    """How far apart their middle lines are at least."""


def near(
    middles: Middles,
    pairs: tuple[np.ndarray, np.ndarray],
    make: Callable[[Near], _Made],
    *,
    margin: float = 0.0,
    slack: float = 0.0,
    anew: np.ndarray | None = None,
) -> Iterator[_Made]:
    """What is made of capsules whose bounding spheres touch, a piece of them at a time.

    Args:
        middles: where capsules are.
        pairs: numbers (pairs,) and (pairs,) of those that count, the first of an earlier chain.
        make: what is to become of some that are near.
        margin: radii by which they may be apart …
        slack: … and by which they may be so in the unit of the joints.
        anew: (frames, chains) whose capsules are asked for, each with all others; else all are.
    """
    if not len(pairs[0]):
        return
    owner = middles.owner
    rounding = 1e-6 * float(middles.squares.max(initial=0.0))
    size = middles.reach + (1.0 + margin) * middles.wide + 0.5 * slack
    limit = np.full((len(owner), len(owner)), -np.inf, dtype=np.float32)
    limit[pairs] = ((size[pairs[0]] + size[pairs[1]]) * (1.0 + _ROUNDED)) ** 2 + rounding
    asked = np.ones((len(middles.places), owner.max() + 1), dtype=bool) if anew is None else anew
    search = _Search(middles, np.maximum(limit, limit.T), rounding, asked)
    for task in search.tasks():
        yield make(search.near_to(*task))


@dataclass(frozen=True, eq=False)
class _Search:
    """A search for what is near to what."""

    middles: Middles
    limit: np.ndarray
    """(capsules, capsules) squares of how far apart each two may be, none below nothing."""
    rounding: float
    """By which squares of distances may be wrong."""
    asked: np.ndarray
    """(frames, chains) whose capsules are asked for."""

    def tasks(self) -> list[tuple[np.ndarray, slice]]:
        """Frames (n,) and capsules of one chain, as many as are looked at in one go."""
        owner, count = self.middles.owner, len(self.limit)
        rows = max(1, _FOR_ONE_THREAD // (5 * count))
        found: list[tuple[np.ndarray, slice]] = []
        for chain in np.flatnonzero(self.asked.any(axis=0)):
            first, last = np.searchsorted(owner, [chain, chain + 1]).tolist()
            frames = np.flatnonzero(self.asked[:, chain])
            for row in range(first, last, rows):
                own = slice(row, min(row + rows, last))
                step = max(1, _AT_ONCE // ((own.stop - row) * count))
                found += [(frames[each], own) for each in portions(len(frames), step)]
        return found

    def near_to(self, frames: np.ndarray, own: slice) -> Near:
        """What is near to some capsules of one chain, at some frames (n,); of two chains that are
        both asked for, the earlier one finds the other's capsules.
        """
        middles, owner = self.middles, self.middles.owner
        chain, begin = owner[own.start], 0
        if self.asked[frames, :chain].all():
            begin = int(np.searchsorted(owner, chain + 1))
        products = _squares(middles, frames, own, begin)
        limits = self.limit[own, begin:]
        # Several times faster than where a row, a column and a frame are found at once.
        spots = np.flatnonzero(products <= limits)
        place, spot = np.divmod(spots, max(limits.size, 1))
        row, column = np.divmod(spot, max(limits.shape[1], 1))
        row, column, frame = row + own.start, column + begin, frames[place]
        squares = products.ravel()[spots]
        if not begin:
            once = (owner[column] > chain) | ~self.asked[frame, owner[column]]
            row, column, frame, squares = (each[once] for each in (row, column, frame, squares))
        distance = np.sqrt(np.maximum(squares - self.rounding, 0.0))
        least = (1.0 - _ROUNDED) * distance - (middles.reach[row] + middles.reach[column])
        return Near(frame, np.minimum(row, column), np.maximum(row, column), least)


def _squares(middles: Middles, frames: np.ndarray, own: slice, begin: int) -> np.ndarray:
    """Squares of the distances (n, rows, columns) of some capsules to all from one on, at frames
    (n,).
    """
    here, there = middles.places[frames, own], middles.places[frames, begin:]
    # |a − b|² = |a|² + |b|² − 2 a · b, all of it in one product.
    first = np.empty((*here.shape[:2], 5), dtype=np.float32)
    first[..., :3], first[..., 3], first[..., 4] = -2.0 * here, middles.squares[frames, own], 1.0
    second = np.empty((len(frames), 5, there.shape[1]), dtype=np.float32)
    second[:, :3] = np.moveaxis(there, 1, 2)
    second[:, 3], second[:, 4] = 1.0, middles.squares[frames, begin:]
    return np.matmul(first, second)


def joined(
    found: Sequence[tuple[np.ndarray, ...]], kinds: tuple[type, ...]
) -> tuple[np.ndarray, ...]:
    """Rows of arrays, one after the other; of so many kinds if there are none."""
    if not found:
        return tuple(np.zeros(0, dtype=kind) for kind in kinds)
    return tuple(np.concatenate(each) for each in zip(*found, strict=True))


def _depths(parts: Parts, chosen: tuple[np.ndarray, np.ndarray, np.ndarray]) -> Floats:
    """Overlap (pairs,) as a share of the smaller radius, negative for those that are apart.

    Of each pair it is asked at a frame, of one capsule and another.
    """
    frame, one, other = chosen
    capsules = len(parts.owner)
    starts, ends = parts.starts.reshape(3, -1), parts.ends.reshape(3, -1)
    radii, first, second = parts.radii, frame * capsules + one, frame * capsules + other
    p, q = starts.take(first, axis=1), starts.take(second, axis=1)
    u, v = ends.take(first, axis=1) - p, ends.take(second, axis=1) - q
    s, t, gap = nearest(p, u, q, v)
    here = (1.0 - s) * radii[0][one] + s * radii[1][one]
    there = (1.0 - t) * radii[0][other] + t * radii[1][other]
    wide, thin = _wide_and_thin(here, there)
    return (wide - np.sqrt(dot(gap, gap))) / np.maximum(thin, _NO_LENGTH)


def _wide_and_thin(here: Floats, there: Floats) -> tuple[Floats, Floats]:
    """Sums (pairs,) of two radii, and the thinner ones: what has no skin there touches nothing, and
    is not some 10³⁰ of its radius deep in it.
    """
    thin, thick = np.minimum(here, there), np.maximum(here, there)
    bare = thin <= _BARE * thick
    return np.where(bare, 0.0, here + there), np.where(bare, thick, thin)


def nearest(p: Floats, u: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
    """Where two segments, from p and from q (3, pairs) along u and v (3, pairs), are nearest to
    each other.

    Shares (pairs,) of the way from start to end on the one and on the other, and the way (3, pairs)
    from there on the other to there on the one.
    """
    w = p - q
    a, b, e = dot(u, u), dot(u, v), dot(v, v)
    c, f = dot(u, w), dot(v, w)
    room = a * e - b * b
    whole = 1.0 / np.maximum(a, _NO_LENGTH)
    s = np.where(room > _PARALLEL * a * e, (b * f - c * e) / np.maximum(room, _NO_LENGTH), 0.0)
    # A capsule that is a ball is nearest to one point of the other.
    s = np.where(e > _NO_LENGTH, s, -c * whole)
    np.clip(s, 0.0, 1.0, out=s)
    t = (b * s + f) / np.maximum(e, _NO_LENGTH)
    s = np.where(t < 0.0, np.clip(-c * whole, 0.0, 1.0), s)
    s = np.where(t > 1.0, np.clip((b - c) * whole, 0.0, 1.0), s)
    np.clip(t, 0.0, 1.0, out=t)
    w += s * u
    w -= t * v
    return s, t, w


def _pairs(
    every: Sequence[Capsules],
    first: np.ndarray,
    second: np.ndarray,
    number: np.ndarray,
    depth: Floats,
) -> tuple[Overlap, ...]:
    key = first * len(every) + second
    order = np.lexsort((-depth, key))
    _, at = np.unique(key[order], return_index=True)
    best = order[at]
    found = [
        Overlap(
            every[int(first[i])].name, every[int(second[i])].name, int(number[i]), float(depth[i])
        )
        for i in best
    ]
    return tuple(sorted(found, key=lambda each: -each.depth))


# --- What is near to what in a crowd of arms, and which way it is to part -------------------------
#
# Two capsules part straight away from each other, unless their middles have nearly met, or met and
# gone on. Then there is no telling from the moment alone, and an arm that passes through another
# would be pushed one way and then the other. So it is told from where the arms begin: each stays on
# its own side of the other, and outside of the body. That changes with nothing, so what comes of it
# has no jumps.


ROOM: Final = 0.1
"""Share of the thinner radius that arms which make way leave between them: skin bulges beyond the
capsules. Without it skin of the default walk cuts skin on bumps at three moments of 37, not two."""
_SOFT: Final = 0.1
"""The same from which on, before that, they begin to make way."""
NEAR: Final = 1.0
"""Sums of radii between arms up to which one may be on the wrong side of the other."""
_BESIDE: Final = 0.4
"""How much less that is where it is on the right side."""
_SLACK: Final = 0.5
"""Mean radii by which what is near may come nearer before it is looked at anew."""
_TINY: Final = 1e-12


@dataclass(frozen=True, eq=False)
class Opened:
    """Arms that stand otherwise round the body for some time than they do at rest."""

    outward: Floats
    """(arms, 3) unit: where each leads to then, seen from the body, armature space."""
    share: Floats
    """(frames,) how far they do so, 0…1."""


@dataclass(frozen=True, eq=False)
class Crowd:
    """All arms of a body over time, in the armature's space."""

    joints: Floats
    """(frames, arms, joints, 3); of an arm that has fewer the last ones are the same."""
    radii: Floats
    """(arms, joints)"""
    at_rest: Floats
    """(arms, joints, 3)"""
    in_contact: np.ndarray
    """(frames, arms, joints) which joints rest on the ground and must not move."""
    kept: np.ndarray
    """(frames, arms) which arms are to stay as they are."""
    upward: Floats
    """(3,) unit: the body's."""
    up: Floats
    """(frames, 3) unit: the world's."""
    opened: Opened | None = None
    """Where arms stand for some time; none if that is where they do at rest."""


@dataclass(frozen=True, eq=False)
class Touches:
    """Capsules that are near to each other, the one of an arm and the other of any chain."""

    frame: np.ndarray
    """(touches,)"""
    arms: tuple[np.ndarray, np.ndarray]
    """Numbers of their chains; those of the body come after all arms."""
    segments: tuple[np.ndarray, np.ndarray]
    shares: tuple[Floats, Floats]
    """Where on the segment, 0…1."""
    gap: Floats
    """(3, touches) from the other to the one."""
    distance: Floats
    wide: Floats
    """Sum of the radii there."""
    thin: Floats
    """The smaller of them."""
    side: Floats
    """(3, touches) on which side of the other the one belongs, unit."""
    pair: np.ndarray
    """(touches,) a number for each two capsules, the same at all frames."""

    @property
    def depth(self) -> Floats:
        """(touches,) by how much they overlap, as a share of the thinner radius."""
        return (self.wide - self.distance) / self.thin


class Touching:
    """The capsules of arms and of parts of the body, for one frame or for all, that are so near to
    each other that they touch, or may have to make way, at all frames.

    Which these are is looked up once and holds for a while (Verlet, Physical Review 159, 1967, 98):
    with some slack for those that move, and anew at frames at which a joint has moved by half of
    that. So what an arm comes near to as it makes way counts as what it was near to before.
    """

    def __init__(self, crowd: Crowd, body: Sequence[Capsules]) -> None:
        frames, arms, joints, _ = crowd.joints.shape
        self._crowd, self._body = crowd, body
        self._arms, self._joints = arms, joints
        parts = self._parts(crowd.joints)
        self._radii, self._owner = parts.radii, parts.owner
        places = _places(crowd, len(body))
        self._sides = _sides(places)
        self._apart: Floats | None = None
        if crowd.opened is not None:
            # The same before they are made unit, at rest and opened: (2, 3, chains, chains).
            both = (places, _opened_places(crowd.opened, places))
            self._apart = np.stack([each.T[:, :, None] - each.T[:, None] for each in both])
        each = joints - 1
        own = arms * each
        # Points of the body after those of all arms: where a capsule starts and, next, ends.
        many = max([len(part.joints) for part in body], default=1)
        ends = np.stack([parts.starts[:, :many, own:], parts.ends[:, :many, own:]], axis=3)
        self._body_points = ends.reshape(3, -1)
        # Where each capsule starts among the points of the first frame, and how many are between
        # frames: of each arm there is a joint more than there are segments.
        number = np.arange(len(self._owner))
        self._first = np.where(
            number < own,
            number + number // each,
            frames * arms * joints + 2 * (number - own),
        )
        between = 2 * (len(number) - own) if many > 1 else 0
        self._step = np.where(number < own, arms * joints, between)
        self._pairs = pairs_of([*self._chains(crowd.joints[:1]), *body], arms)
        self._slack = _SLACK * float(crowd.radii.mean())
        self._seen_at = crowd.joints
        self._watched = np.zeros(frames, dtype=bool)
        self._middles = Middles.of(parts)
        self._rows = np.zeros((3, 0), dtype=np.intp)

    def _chains(self, joints: Floats) -> list[Capsules]:
        crowd = self._crowd
        return [
            Capsules("", joints[:, arm], crowd.radii[arm], crowd.at_rest[arm])
            for arm in range(self._arms)
        ]

    def _parts(self, joints: Floats) -> Parts:
        """The capsules of arms with joints (frames, arms, joints, 3), and of the body."""
        body = [
            Capsules(
                "",
                np.broadcast_to(each.joints, (len(joints), *each.joints.shape[1:])),
                each.radii,
                each.at_rest,
            )
            for each in self._body
        ]
        return parts_of([*self._chains(joints), *body])

    def seeing(self) -> Generator[float, None, Touches]:
        """What overlaps while nobody has made way yet; in steps."""
        points = self._points(self._crowd.joints)

        def overlapping(found: Near) -> Touches:
            touches = self._at(points, np.stack([found.frame, found.one, found.other]))
            return part_of(touches, touches.depth > 0.0)

        found = [self._at(points, np.zeros((3, 0), dtype=np.intp))]
        for each in near(self._middles, self._pairs, overlapping):
            found.append(each)
            yield 0.0
        return all_of(found)

    def looking_at(self, frames: np.ndarray, without: np.ndarray) -> Generator[float, None, None]:
        """Look from now on only at what is near enough for arms that make way, in frames (frames,)
        in which anybody may have to; in steps.

        Some pairs (``Touches.pair``) are left as they are.
        """
        one, other = self._pairs
        kept = ~np.isin(one * len(self._owner) + other, without)
        self._pairs = one[kept], other[kept]
        self._watched, self._seen_at = frames, self._crowd.joints.copy()
        found: list[np.ndarray] = []
        for each in self._near(np.repeat(frames[:, None], self._arms, axis=1)):
            found.append(each)
            yield 0.0
        self._rows = _joined(found)

    def _near(self, anew: np.ndarray) -> Iterator[np.ndarray]:
        """Frame, the one and the other (3, n) of what is near to arms (frames, arms) where joints
        were seen, a piece at a time.
        """
        asked = np.zeros((len(anew), self._arms + len(self._body)), dtype=bool)
        asked[:, : self._arms] = anew
        points = self._points(self._seen_at)

        def near_enough(found: Near) -> np.ndarray:
            wide = self._middles.wide[found.one] + self._middles.wide[found.other]
            # On its own side an arm has less far to be looked for.
            chosen = np.ones(len(wide), dtype=bool)
            far = np.flatnonzero(found.least > (1.0 + _BESIDE * NEAR) * wide + self._slack)
            rows = np.stack([found.frame, found.one, found.other])
            chosen[far] = self._may_be_wrong(points, rows[:, far])
            rows = rows[:, chosen]
            seen = self._at(points, rows)
            wrong = dot(seen.gap, seen.side) < self._slack
            reach = (1.0 + np.where(wrong, NEAR, _BESIDE * NEAR)) * seen.wide + self._slack
            return rows[:, seen.distance <= reach]

        return near(
            self._middles, self._pairs, near_enough, margin=NEAR, slack=self._slack, anew=asked
        )

    def _may_be_wrong(self, points: Floats, rows: np.ndarray) -> np.ndarray:
        """Which may be on the wrong side of each other, told from where their middles are."""
        ends = [
            points.take(each + self._starts(rows, which), axis=1)
            for which in (1, 2)
            for each in (0, 1)
        ]
        apart = 0.5 * (ends[0] + ends[1]) - 0.5 * (ends[2] + ends[3])
        steps = ends[1] - ends[0], ends[3] - ends[2]
        half, other_half = (0.5 * np.sqrt(dot(each, each)) for each in steps)
        return dot(apart, self._side(*rows)) <= half + other_half + self._slack

    def looking_again(self, joints: Floats) -> Generator[float, None, None]:
        """Look anew at arms that have moved too far, of joints (frames, arms, joints, 3); in steps,
        between which nobody asks.
        """
        moved = joints - self._seen_at
        squares = np.einsum("fajc,fajc->faj", moved, moved).max(axis=2)
        anew = self._watched[:, None] & (squares > (0.5 * self._slack) ** 2)
        if not anew.any():
            return
        self._seen_at[anew] = joints[anew]
        self._middles = Middles.of(self._parts(self._seen_at))
        frame, one, other = self._rows
        moving = np.zeros((len(anew), self._arms + len(self._body)), dtype=bool)
        moving[:, : self._arms] = anew
        kept = ~(moving[frame, self._owner[one]] | moving[frame, self._owner[other]])
        found = [self._rows[:, kept]]
        for each in self._near(anew):
            found.append(each)
            yield 0.0
        rows = _joined(found)
        # In an order of their own: sums over them come out the same, whatever moved before.
        count = len(self._owner)
        self._rows = rows[
            :, np.argsort((rows[0] * count + rows[1]) * count + rows[2], kind="stable")
        ]

    def _side(self, frame: np.ndarray, one: np.ndarray, other: np.ndarray) -> Floats:
        """On which side (3, capsules) of others some belong at a frame."""
        chains = self._owner[one] * self._sides.shape[2] + self._owner[other]
        if self._apart is None or self._crowd.opened is None:
            return self._sides.reshape(3, -1).take(chains, axis=1)
        share = self._crowd.opened.share[frame]
        closed, opened = (each.reshape(3, -1).take(chains, axis=1) for each in self._apart)
        apart = (1.0 - share) * closed + share * opened
        return apart / np.maximum(np.sqrt(dot(apart, apart)), _TINY)

    def at(self, joints: Floats) -> Touches:
        """What is near to what, for joints (frames, arms, joints, 3)."""
        finished(self.looking_again(joints))
        return all_of(list(self.of_each(joints, lambda touches: touches)))

    def of_each(self, joints: Floats, make: Callable[[Touches], _Made]) -> Iterator[_Made]:
        """What is made of some of that after the other; one at least.

        To be called where :meth:`looking_again` has been.
        """
        points = self._points(joints)
        for piece in portions(self._rows.shape[1], _ROWS_AT_ONCE) or [slice(0, 0)]:
            yield make(self._at(points, self._rows[:, piece]))

    def _points(self, joints: Floats) -> Floats:
        """(3, points) where capsules start and end: joints (frames, arms, joints, 3), the body."""
        return np.concatenate([joints.reshape(-1, 3).T, self._body_points], axis=1)

    def _starts(self, rows: np.ndarray, which: int) -> np.ndarray:
        """Which points the one or the other start at; the ones after these are their ends."""
        return rows[0] * self._step[rows[which]] + self._first[rows[which]]

    def _at(self, points: Floats, rows: np.ndarray) -> Touches:
        """The same of some capsules (3, n), where these points are."""
        frame, one, other = rows
        first, second = (self._starts(rows, which) for which in (1, 2))
        p, q = points.take(first, axis=1), points.take(second, axis=1)
        u, v = points.take(first + 1, axis=1) - p, points.take(second + 1, axis=1) - q
        s, t, gap = nearest(p, u, q, v)
        here, there = (
            (1.0 - share) * self._radii[0][which] + share * self._radii[1][which]
            for share, which in ((s, one), (t, other))
        )
        each = self._joints - 1
        wide, thin = _wide_and_thin(here, there)
        return Touches(
            frame=frame,
            arms=(self._owner[one], self._owner[other]),
            segments=(one % each, other % each),
            shares=(s, t),
            gap=gap,
            distance=np.sqrt(dot(gap, gap)),
            wide=np.maximum(wide, _TINY),
            thin=np.maximum(thin, _TINY),
            side=self._side(frame, one, other),
            pair=one * len(self._owner) + other,
        )


def _joined(found: Iterable[np.ndarray]) -> np.ndarray:
    """Rows (3, n) one after the other."""
    return np.concatenate([np.zeros((3, 0), dtype=np.intp), *found], axis=1)


def all_of(found: Sequence[Touches]) -> Touches:
    """All touches, one after the other; there is at least one piece of them."""

    def joined_up(values: list[Any]) -> Any:
        if isinstance(values[0], tuple):
            return tuple(joined_up(list(each)) for each in zip(*values, strict=True))
        return np.concatenate(values, axis=-1)

    names = [each.name for each in fields(Touches)]
    return Touches(**{name: joined_up([getattr(each, name) for each in found]) for name in names})


def _places(crowd: Crowd, body: int) -> Floats:
    """Where chains (chains, 3) begin, seen from above: arms round the body, the body inside."""
    roots = crowd.at_rest[:, 1]
    middle = np.broadcast_to(crowd.at_rest[:, 0].mean(axis=0), (body, 3))
    places = np.concatenate([roots, middle])
    return places - (places @ crowd.upward)[:, None] * crowd.upward


def _opened_places(opened: Opened, places: Floats) -> Floats:
    """Where chains (chains, 3) begin that have opened, as far from the body as before."""
    arms = len(opened.outward)
    middle = places[:arms].mean(axis=0)
    away = np.sqrt(np.mean(np.sum((places[:arms] - middle) ** 2, axis=1)))
    result = np.broadcast_to(middle, places.shape).copy()
    result[:arms] += away * opened.outward
    return result


def _sides(places: Floats) -> Floats:
    """On which side of each chain (3, chains, chains), the second, each one, the first, belongs."""
    apart = places.T[:, :, None] - places.T[:, None]
    return apart / np.maximum(np.sqrt(np.sum(apart * apart, axis=0)), _TINY)


def aside(touches: Touches, *, nearest: bool = False) -> tuple[Floats, Floats]:
    """How the one of each pair has to move against the other for them to touch no more: to the side
    on which it belongs, or the nearest way.

    Unit vectors (3, touches) say which way, and how far (touches,), 0 where they are apart.
    """
    apart = touches.distance / touches.wide
    straight = touches.gap / np.maximum(touches.distance, _TINY)
    if nearest:
        return straight, _softly(touches, touches.wide + ROOM * touches.thin - touches.distance)
    wrong = np.maximum(-dot(straight, touches.side), 0.0)
    # From too far it is not to be told whether they have passed through each other at all.
    told = smooth_step((1.0 + NEAR - apart) / NEAR)
    back = np.maximum(1.0 - apart, 0.0) + wrong * told
    inside = np.minimum(apart, 1.0)
    way = inside * straight + (inside * wrong + back) * touches.side
    way /= np.maximum(np.sqrt(dot(way, way)), _TINY)
    along = dot(touches.gap, way)
    # |gap + far · way| is to be as long as that.
    least = touches.wide + ROOM * touches.thin
    across = touches.distance**2 - along**2
    far = np.sqrt(np.maximum(least**2 - across, 0.0)) - along
    return way, told * _softly(touches, far)


def _softly(touches: Touches, far: Floats) -> Floats:
    """How far (touches,) they are asked to go that have so far to: it begins gently."""
    soft = _SOFT * touches.thin
    return np.where(far > soft, far, np.maximum(far + soft, 0.0) ** 2 / (4.0 * soft))


def portions(length: int, most: int) -> list[slice]:
    """Slices of a row of that length that follow one another, of so many items at most each, and of
    as many items each as the others: a portion at a time stays in the processor's cache.
    """
    count = -(-length // most)
    ends = [length * number // count for number in range(count + 1)] if count else []
    return [slice(start, end) for start, end in pairwise(ends)]
