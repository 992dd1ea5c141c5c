# SPDX-License-Identifier: GPL-3.0-or-later
"""People on skeletons as strangers bring them, whose motion is known beforehand.

One body of rigid segments walks, throws or dances; a skeleton is a way to hang bones on these
segments: any names, any order of parents, twist bones, helpers, axes, rest pose, units. So it is
known where each joint has to be after any splice, without a look at how splices are made.
Matrices alone: nothing here is octo_motion's but the arrays that it is handed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from octo_motion.core.rotations import Floats
from octo_motion.core.skeleton import Skeleton
from octo_motion.core.splicing.clip.clip import Clip
from tests.core.rigs import skeleton_of

RATE = 30.0

PLACES: dict[str, tuple[str, tuple[float, float, float]]] = {
    # What a bone may begin at: its segment, and where that is in a T-pose (left side; faces −Y).
    "root": ("root", (0.0, 0.0, 0.0)),
    "hips": ("pelvis", (0.0, 0.0, 1.0)),
    "seat": ("pelvis", (0.0, 0.0, 0.96)),
    **{f"s{n}": (f"trunk{n}", (0.0, 0.02, 1.04 + 0.04 * n)) for n in range(1, 10)},
    "chest": ("chest", (0.0, 0.02, 1.32)),
    "neck": ("neck", (0.0, 0.015, 1.50)),
    "neck2": ("neck", (0.0, 0.01, 1.55)),
    "head": ("head", (0.0, 0.0, 1.60)),
    "top": ("head", (0.0, 0.0, 1.80)),
    "jaw": ("head", (0.0, -0.03, 1.61)),
    "nose": ("head", (0.0, -0.12, 1.66)),
    "eye": ("head", (0.03, -0.10, 1.70)),
    "bust": ("chest", (0.08, -0.10, 1.35)),
    "clavicle": ("clavicle", (0.03, 0.0, 1.45)),
    "upper_arm": ("upper_arm", (0.18, 0.02, 1.45)),
    "upper_arm_middle": ("upper_arm", (0.32, 0.02, 1.45)),
    "forearm": ("forearm", (0.46, 0.02, 1.45)),
    "forearm_middle": ("forearm", (0.59, 0.02, 1.45)),
    "hand": ("hand", (0.72, 0.02, 1.45)),
    **{
        f"{name}{n}": ("hand", (0.77 + 0.035 * n, y, 1.44))
        for name, y in (("index", -0.02), ("middle", 0.0), ("ring", 0.02), ("pinky", 0.04))
        for n in range(5)
    },
    **{f"thumb{n}": ("hand", (0.74 + 0.02 * n, -0.03 - 0.02 * n, 1.43)) for n in range(5)},
    "hip_joint": ("pelvis", (0.0, 0.0, 0.99)),
    "thigh": ("thigh", (0.10, 0.0, 0.95)),
    "thigh_middle": ("thigh", (0.10, 0.0, 0.73)),
    "shin": ("shin", (0.10, 0.0, 0.51)),
    "shin_middle": ("shin", (0.10, 0.01, 0.30)),
    "foot": ("foot", (0.10, 0.02, 0.09)),
    "heel": ("foot", (0.10, 0.06, 0.0)),
    "toe": ("toe", (0.10, -0.12, 0.02)),
    "tip": ("toe", (0.10, -0.19, 0.02)),
    "sole": ("root", (0.10, 0.02, 0.0)),
}
_SIDED = {"clavicle", "upper_arm", "forearm", "hand", "thigh", "shin", "foot", "toe"}
_CARRIERS = {
    # Segment: what it hangs on, and the joint about which it turns.
    "pelvis": ("", "hips"),
    "chest": ("pelvis", "s1"),
    "neck": ("chest", "neck"),
    "head": ("neck", "head"),
    "clavicle": ("chest", "clavicle"),
    "upper_arm": ("clavicle", "upper_arm"),
    "forearm": ("upper_arm", "forearm"),
    "hand": ("forearm", "hand"),
    "thigh": ("pelvis", "thigh"),
    "shin": ("thigh", "shin"),
    "foot": ("shin", "foot"),
    "toe": ("foot", "toe"),
}

Action = Literal["walk", "throw", "dance", "balance", "stork"]


def about(axis: str, degrees: Floats | float) -> Floats:
    """(…, 3, 3) rotations about an axis of the world."""
    angle = np.radians(np.asarray(degrees, dtype=float))
    one, sine, cosine = np.ones_like(angle), np.sin(angle), np.cos(angle)
    none = np.zeros_like(angle)
    rows = {
        "x": [one, none, none, none, cosine, -sine, none, sine, cosine],
        "y": [cosine, none, sine, none, one, none, -sine, none, cosine],
        "z": [cosine, -sine, none, sine, cosine, none, none, none, one],
    }[axis]
    return np.stack(rows, axis=-1).reshape(*angle.shape, 3, 3)


def local_turns(action: Action, frames: int) -> dict[str, Floats]:
    """How each segment turns against what carries it, (frames, 3, 3), from a T-pose.

    Degrees about x lean forward where positive, arms hang by ±75° about y.
    """
    time = np.arange(frames) / RATE
    step = 2.0 * np.pi * time / 1.1
    wave, slow = np.sin(step), np.sin(2.0 * np.pi * time / 3.1)
    throwing, dancing, balancing = (action == each for each in ("throw", "dance", "balance"))
    leans = {"throw": 8.0 + 6.0 * slow, "dance": 6.0 + 14.0 * slow}
    lean = leans.get(action, 4.0 + 0.0 * wave)
    twist = 6.0 * wave + (18.0 * slow if throwing or dancing else 0.0)
    made = {
        "pelvis": about("z", -5.0 * wave) @ about("x", 2.0 + 2.0 * np.cos(2.0 * step)),
        "chest": about("z", twist) @ about("x", lean) @ about("y", 8.0 * slow * dancing),
        "neck": about("x", 6.0 + 3.0 * slow) @ about("z", -0.3 * twist),
        "head": about("x", -10.0 + 8.0 * slow) @ about("z", 12.0 * slow) @ about("y", 4.0 * wave),
    }
    for side, sign in (("L", 1.0), ("R", -1.0)):
        swing = sign * wave
        raised = (55.0 + 50.0 * slow) * (throwing and side == "R") + 45.0 * dancing * (1 + slow)
        bend = 25.0 + 12.0 * swing + 0.7 * raised
        made[f"clavicle.{side}"] = about("y", sign * (3.0 - 0.1 * raised)) @ about("z", 2.0 * swing)
        made[f"upper_arm.{side}"] = (
            about("x", -22.0 * swing - 0.4 * raised)
            @ about("y", sign * (72.0 - raised))
            @ about("x", -12.0 - 0.3 * raised)
        )
        made[f"forearm.{side}"] = about("z", -sign * bend) @ about("x", 10.0 * slow)
        made[f"hand.{side}"] = about("y", sign * 8.0 * swing) @ about("x", 10.0 * slow)
        made[f"thigh.{side}"] = about("x", -6.0 + 24.0 * swing) @ about("y", -2.0 * sign)
        knee = 8.0 + 24.0 * (1.0 + np.sin(step * 1.0 + (0.9 if sign > 0 else 0.9 + np.pi)))
        made[f"shin.{side}"] = about("x", knee)
        made[f"foot.{side}"] = about("x", 4.0 - 0.5 * knee - 10.0 * swing)
        made[f"toe.{side}"] = about("x", -8.0 * (1.0 + swing))
        if balancing and side == "L":
            # It stands flat and is turned out.
            above = made["pelvis"] @ made["thigh.L"] @ made["shin.L"]
            made["foot.L"] = above.transpose(0, 2, 1) @ about("z", 35.0)
        elif balancing:
            # It never stands, and is stretched.
            made["thigh.R"] = about("x", -15.0) @ made["thigh.R"]
            made["shin.R"] = about("x", 40.0) @ made["shin.R"]
            made["foot.R"] = about("x", 25.0) @ made["foot.R"]
        if action == "stork":
            # One leg is up all the time, the other one straight.
            hip, knee = (-80.0, 40.0) if side == "R" else (-4.0 + 2.0 * slow, 3.0)
            made[f"thigh.{side}"], made[f"shin.{side}"] = about("x", hip), about("x", knee)
    return made


@dataclass(frozen=True, eq=False)
class Mover:
    """The body, doing something."""

    action: Action
    frames: int = 100
    stretch: Mapping[str, float] = field(default_factory=dict[str, float])
    """How much longer or wider than usual: of "legs", "arms", "trunk", "width", "head"."""

    def at_rest(self, key: str, side: str = "") -> Floats:
        """Where a joint is in a T-pose."""
        place = np.array(PLACES[key][1])
        longer = {name: self.stretch.get(name, 1.0) for name in _STRETCHED}
        legs, trunk = 0.95 * longer["legs"], 0.55 * longer["trunk"]
        x, y, z = place
        arm = PLACES[key][0] in {"upper_arm", "forearm", "hand"}
        if arm:
            x = longer["width"] * 0.18 + longer["arms"] * (x - 0.18)
        else:
            x *= longer["width"]
        if z <= 0.95:
            z *= longer["legs"]
        elif z <= 1.5:
            z = legs + (z - 0.95) * longer["trunk"]
        else:
            z = legs + trunk + (z - 1.5) * longer["head"]
        return np.array([-x if side == "R" else x, y, z])

    @cached_property
    def turns(self) -> dict[str, Floats]:
        """(frames, 3, 3) of each segment from its T-pose, in the world."""
        local = local_turns(self.action, self.frames)
        made: dict[str, Floats] = {"root": np.broadcast_to(np.eye(3), (self.frames, 3, 3))}
        for segment, (carrier, _) in _CARRIERS.items():
            for side in ("L", "R") if f"{segment}.L" in local else ("",):
                name = f"{segment}.{side}" if side else segment
                above = f"{carrier}.{side}" if f"{carrier}.{side}" in made else carrier
                made[name] = made[above] @ local[name] if above else local[name]
        # The spine bends evenly from pelvis to chest.
        vectors = _vectors(local["chest"])
        for n in range(1, 10):
            share = min(n / 7.0, 1.0)
            made[f"trunk{n}"] = made["pelvis"] @ _turned(share * vectors)
        return made

    @cached_property
    def _joints(self) -> dict[str, Floats]:
        """(frames, 3) where each segment's joint is; pelvis at its place in the world."""
        found = {"root": np.zeros((self.frames, 3)), "pelvis": np.zeros((self.frames, 3))}
        for segment, (carrier, joint) in list(_CARRIERS.items())[1:]:
            for side in ("L", "R") if f"{segment}.L" in self.turns else ("",):
                name = f"{segment}.{side}" if side else segment
                above = f"{carrier}.{side}" if f"{carrier}.{side}" in found else carrier
                if segment == "chest":
                    found[name] = self._up_the_spine(found["pelvis"], 7)
                    continue
                offset = self._from(carrier, joint, side)
                found[name] = found[above] + self.turns[above] @ offset
        for n in range(1, 10):
            found[f"trunk{n}"] = self._up_the_spine(found["pelvis"], n)
        moved = self._way(found)
        return {name: each if name == "root" else each + moved for name, each in found.items()}

    def _up_the_spine(self, start: Floats, n: int) -> Floats:
        place = start + self.turns["pelvis"] @ (self.at_rest("s1") - self.at_rest("hips"))
        for lower in range(1, n):
            step = self.at_rest(f"s{lower + 1}") - self.at_rest(f"s{lower}")
            place = place + self.turns[f"trunk{lower}"] @ step
        return place

    def _from(self, segment: str, joint: str, side: str) -> Floats:
        """From a segment's joint to another one on it, in a T-pose."""
        start = "chest" if segment == "chest" else _CARRIERS[segment][1]
        return self.at_rest(joint, side) - self.at_rest(start, side if start in _SIDED else "")

    def _way(self, found: Mapping[str, Floats]) -> Floats:
        """How the pelvis goes so that the lower foot stands: (frames, 3)."""
        soles = np.stack(
            [
                found[f"{segment}.{side}"] + self.turns[f"{segment}.{side}"] @ offset
                for side in "LR"
                for segment, offset in (
                    ("foot", self.at_rest("heel") - self.at_rest("foot")),
                    ("toe", np.array([0.0, 0.0, -self.at_rest("toe")[2]])),
                )
            ],
            axis=1,
        )
        lowest = soles[..., 2].argmin(axis=1)
        rows = np.arange(self.frames)
        height = -soles[rows, lowest, 2]
        steps = soles[rows[1:], lowest[:-1]] - soles[rows[:-1], lowest[:-1]]
        way = np.concatenate([np.zeros((1, 3)), np.cumsum(-steps, axis=0)])
        return np.column_stack([way[:, :2], height])

    def place(self, key: str, side: str = "") -> Floats:
        """(frames, 3) where a joint is."""
        segment = PLACES[key][0]
        name = f"{segment}.{side}" if f"{segment}.{side}" in self.turns else segment
        if segment == "root":
            return np.broadcast_to(self.at_rest(key, side), (self.frames, 3))
        if segment.startswith("trunk"):
            return self._joints[name]
        return self._joints[name] + self.turns[name] @ self._from(segment, key, side)

    def segment(self, key: str, side: str) -> Floats:
        """(frames, 3, 3) how the segment of a joint is turned."""
        segment = PLACES[key][0]
        return self.turns[f"{segment}.{side}" if f"{segment}.{side}" in self.turns else segment]


_STRETCHED = ("legs", "arms", "trunk", "width", "head")


def _vectors(turns: Floats) -> Floats:
    """Rotation vectors of rotations by less than half a turn."""
    cosine = (np.trace(turns, axis1=-2, axis2=-1) - 1.0) / 2.0
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    skew = np.stack(
        [
            turns[..., 2, 1] - turns[..., 1, 2],
            turns[..., 0, 2] - turns[..., 2, 0],
            turns[..., 1, 0] - turns[..., 0, 1],
        ],
        axis=-1,
    )
    return 0.5 * skew / np.sinc(angle / np.pi)[..., None]


def _turned(vectors: Floats) -> Floats:
    """Rotations (…, 3, 3) by rotation vectors, after Rodrigues."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(vectors, -1, 0)
    none = np.zeros_like(x)
    skew = np.stack([none, -z, y, z, none, -x, -y, x, none], axis=-1).reshape(*x.shape, 3, 3)
    half = np.sinc(angle / (2.0 * np.pi))
    return np.eye(3) + np.sinc(angle / np.pi) * skew + 0.5 * half**2 * skew @ skew


# --- Skeletons ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Bone:
    """Of a kind of skeleton."""

    name: str
    parent: str
    key: str
    side: str = ""


def kind(text: str, left: str = "", right: str = "") -> tuple[Bone, ...]:
    """Bones of a kind of skeleton.

    Args:
        text: chains of "Name@place", one a line, each bone on the one before; the first word of a
            chain is the bone on which it hangs, "-" for none. Chains with "{}" in a name are there
            for both sides. Lines that begin with spaces go on with the one before; "~" is a space.
        left: what stands for "{}" on the left.
        right: on the right.
    """
    bones: list[Bone] = []
    for line in text.strip().replace("\n  ", " ").splitlines():
        parent, *chain = (word.replace("~", " ") for word in line.split())
        sides = (("L", left), ("R", right)) if "{}" in line else (("", ""),)
        for side, word in sides:
            above = "" if parent == "-" else parent.replace("{}", word)
            for each in chain:
                name, _, key = each.rpartition("@")
                bones.append(Bone(name.replace("{}", word), above, key, side))
                above = bones[-1].name
    return tuple(bones)


Axes = Literal["along", "world", "x", "anyhow"]
RestPose = Literal["T", "A", "hanging", "along x", "leaning", "crouching"]


@dataclass(frozen=True, eq=False)
class Stranger:
    """A clip on some kind of skeleton, and the body that it is of."""

    mover: Mover
    bones: tuple[Bone, ...]
    axes: Axes = "along"
    rest: RestPose = "T"
    unit: float = 1.0
    """Metres of one armature unit."""
    y_up: bool = False
    """Whether the armature lies on its back and its object stands it up."""
    seed: int = 0

    @cached_property
    def clip(self) -> Clip:
        """As it is read from Blender."""
        index = {bone.name: number for number, bone in enumerate(self.bones)}
        parents = [index.get(bone.parent, -1) for bone in self.bones]
        up = about("x", -90.0) if self.y_up else np.eye(3)
        world = np.eye(4)
        world[:3, :3] = self.unit * up.T
        at_rest = self._at_rest(parents)
        own_axes = self._own_axes()
        frames = self.mover.frames
        places = np.stack([self.mover.place(b.key, b.side) for b in self.bones], axis=1)
        turns = np.stack([self.mover.segment(b.key, b.side) for b in self.bones], axis=1)
        places, turns = places / self.unit @ up.T, up @ turns @ own_axes
        rests = np.tile(np.eye(4), (len(self.bones), 1, 1))
        rests[:, :3, :3] = up @ at_rest[0] @ own_axes
        rests[:, :3, 3] = at_rest[1] / self.unit @ up.T
        rotations = np.empty((frames, len(self.bones), 4))
        locations = np.empty((frames, len(self.bones), 3))
        for bone, parent in enumerate(parents):
            own, place = rests[bone, :3, :3], rests[bone, :3, 3]
            carried, head = own, place
            if parent >= 0:
                above = rests[parent, :3, :3]
                turn = turns[:, parent] @ above.T
                carried, head = (
                    turn @ own,
                    places[:, parent] + turn @ (place - rests[parent, :3, 3]),
                )
            rotations[:, bone] = quaternions(np.swapaxes(carried, -1, -2) @ turns[:, bone])
            moved = places[:, bone] - head
            locations[:, bone] = np.einsum(
                "...ji,...j->...i", np.broadcast_to(carried, (frames, 3, 3)), moved
            )
        skeleton = skeleton_of(
            [bone.name for bone in self.bones], parents, list(rests), self._lengths(parents)
        )
        return Clip(
            "stranger",
            skeleton,
            np.arange(1.0, frames + 1.0),
            RATE,
            rotations,
            locations,
            np.broadcast_to(world, (frames, 4, 4)).copy(),
        )

    def _lengths(self, parents: list[int]) -> list[float]:
        heads = np.array([self.mover.at_rest(b.key, b.side) for b in self.bones])
        lengths = []
        for bone in range(len(self.bones)):
            children = [child for child, above in enumerate(parents) if above == bone]
            steps = [float(np.linalg.norm(heads[child] - heads[bone])) for child in children]
            lengths.append(max([0.05, *steps]) / self.unit)
        return lengths

    def _at_rest(self, parents: list[int]) -> tuple[Floats, Floats]:
        """Turns (bones, 3, 3) and heads (bones, 3) at rest, from a T-pose, metres, Z up."""
        heads = np.array([self.mover.at_rest(b.key, b.side) for b in self.bones])
        pose = _REST_POSES[self.rest]
        turns = np.array([pose(PLACES[b.key][0], b.side) for b in self.bones])
        if self.rest == "along x":
            turns = np.array([self._along_x(bone, heads, parents) for bone in range(len(heads))])
        places = heads.copy()
        for bone, parent in enumerate(parents):
            if parent >= 0:
                places[bone] = places[parent] + turns[parent] @ (heads[bone] - heads[parent])
        return turns, places

    def _along_x(self, bone: int, heads: Floats, parents: list[int]) -> Floats:
        way = self._way_of(bone, heads, parents)
        return _from_to(way, np.array([-1.0 if self.bones[bone].side == "L" else 1.0, 0.0, 0.0]))

    def _way_of(self, bone: int, heads: Floats, parents: list[int]) -> Floats:
        steps = [heads[child] - heads[bone] for child, above in enumerate(parents) if above == bone]
        steps = [each for each in steps if np.linalg.norm(each) > 0.01]
        if steps:
            longest = max(steps, key=lambda each: float(np.linalg.norm(each)))
            return longest / np.linalg.norm(longest)
        if parents[bone] >= 0:
            back = heads[bone] - heads[parents[bone]]
            if np.linalg.norm(back) > 0.01:
                return back / np.linalg.norm(back)
        return np.array([0.0, 0.0, 1.0])

    def _own_axes(self) -> Floats:
        """(bones, 3, 3) of each bone, in a T-pose."""
        index = {bone.name: number for number, bone in enumerate(self.bones)}
        parents = [index.get(bone.parent, -1) for bone in self.bones]
        heads = np.array([self.mover.at_rest(b.key, b.side) for b in self.bones])
        generator = np.random.default_rng(self.seed)
        made = []
        for number, bone in enumerate(self.bones):
            way = self._way_of(number, heads, parents)
            if self.axes == "world":
                made.append(np.eye(3))
            elif self.axes == "x":
                sign = -1.0 if bone.side == "R" else 1.0
                made.append(_from_to(np.array([sign, 0.0, 0.0]), way))
            elif self.axes == "along":
                made.append(_from_to(np.array([0.0, 1.0, 0.0]), way))
            else:
                made.append(_turned(generator.normal(size=3)))
        return np.array(made)


def _limp(segment: str, side: str) -> Floats:  # noqa: ARG001
    return np.eye(3)


def _arms(degrees: float) -> Callable[[str, str], Floats]:
    def pose(segment: str, side: str) -> Floats:
        if segment not in {"upper_arm", "forearm", "hand"}:
            return np.eye(3)
        return about("y", degrees if side == "L" else -degrees)

    return pose


def _leaning(segment: str, side: str) -> Floats:  # noqa: ARG001
    return np.eye(3) if segment == "root" else about("x", 24.0)


def _crouching(segment: str, side: str) -> Floats:
    if segment in {"pelvis", "thigh", "shin", "foot", "toe", "root"}:
        angle = {"thigh": -50.0, "shin": 30.0, "pelvis": 15.0}.get(segment, 0.0)
        return about("x", angle)
    arm = _arms(60.0)(segment, side) if segment in {"upper_arm", "forearm", "hand"} else np.eye(3)
    return about("x", 30.0) @ arm


_REST_POSES: dict[str, Callable[[str, str], Floats]] = {
    "T": _limp,
    "A": _arms(45.0),
    "hanging": _arms(82.0),
    "leaning": _leaning,
    "crouching": _crouching,
    "along x": _limp,
}


def _from_to(first: Floats, second: Floats) -> Floats:
    """(3, 3) the smallest rotation from one direction to another."""
    axis, cosine = np.cross(first, second), float(first @ second)
    if cosine < -1.0 + 1e-9:
        other = np.eye(3)[int(np.argmin(np.abs(first)))]
        other = other - (other @ first) * first
        other /= np.linalg.norm(other)
        return 2.0 * np.outer(other, other) - np.eye(3)
    skew = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + skew + skew @ skew / (1.0 + cosine)


def quaternions(turns: Floats) -> Floats:
    """(…, 4) of rotation matrices."""
    m = turns
    trace = np.trace(m, axis1=-2, axis2=-1)
    # From the largest of four, so that nothing is divided by nearly nothing.
    w, x = 1.0 + trace, 1.0 + 2.0 * m[..., 0, 0] - trace
    y, z = 1.0 + 2.0 * m[..., 1, 1] - trace, 1.0 + 2.0 * m[..., 2, 2] - trace
    a, b, c = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    d, e, f = m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]
    rows = np.stack(
        [
            np.stack([w, a, b, c], axis=-1),
            np.stack([a, x, d, e], axis=-1),
            np.stack([b, d, y, f], axis=-1),
            np.stack([c, e, f, z], axis=-1),
        ],
        axis=-2,
    )
    best = np.argmax(np.stack([w, x, y, z], axis=-1), axis=-1)
    found = np.take_along_axis(rows, best[..., None, None], axis=-2)[..., 0, :]
    return found / np.linalg.norm(found, axis=-1, keepdims=True)


def played(clip: Clip) -> tuple[Floats, Floats]:
    """World turns (frames, bones, 3, 3) and heads (frames, bones, 3) of a clip, by matrices."""
    skeleton: Skeleton = clip.skeleton
    frames = len(clip)
    w, x, y, z = np.moveaxis(clip.rotations, -1, 0)
    own = np.stack(
        [
            *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        ],
        axis=-1,
    ).reshape(frames, -1, 3, 3)
    poses = np.tile(np.eye(4), (frames, len(skeleton), 1, 1))
    for bone, parent in enumerate(skeleton.parents):
        basis = np.tile(np.eye(4), (frames, 1, 1))
        basis[:, :3, :3], basis[:, :3, 3] = own[:, bone], clip.locations[:, bone]
        rest = skeleton.rest_matrices[bone]
        if parent >= 0:
            rest = np.linalg.inv(skeleton.rest_matrices[parent]) @ rest
            poses[:, bone] = poses[:, parent] @ rest @ basis
        else:
            poses[:, bone] = rest @ basis
    poses = clip.world[:, None] @ poses
    scale = np.cbrt(np.linalg.det(poses[..., :3, :3]))[..., None, None]
    return poses[..., :3, :3] / scale, poses[..., :3, 3]
