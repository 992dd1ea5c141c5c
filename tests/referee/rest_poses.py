# SPDX-License-Identifier: GPL-3.0-or-later
"""BVH files with another rest pose, that play as they did: every joint is where it was.

A joint's rotation in the world W becomes W·A with any constant rotation A. Then the offsets of its
children are A⁻¹·o, and what its channels say is A_parent⁻¹·L·A. Whoever looks at joints sees no
difference; whoever believes in the rest pose sees another person.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .recording import Floats

_AXES = {"X": 0, "Y": 1, "Z": 2}


@dataclass
class Joint:
    """One of a file's."""

    name: str
    parent: int
    offset: Floats
    channels: list[str] = field(default_factory=list)
    end: Floats | None = None


@dataclass
class Bvh:
    """A file as numbers."""

    joints: list[Joint]
    frame_time: float
    motion: Floats
    """(frames, channels)."""

    @classmethod
    def read(cls, path: Path) -> Bvh:
        """A file that is well formed."""
        words = iter(path.read_text(encoding="utf-8").split())
        joints: list[Joint] = []
        open_joints: list[int] = []
        ending = False
        for word in words:
            if word in {"ROOT", "JOINT"}:
                parent = open_joints[-1] if open_joints else -1
                joints.append(Joint(next(words), parent, np.zeros(3)))
            elif word == "End":
                ending = next(words) == "Site"
            elif word == "{":
                open_joints.append(open_joints[-1] if ending else len(joints) - 1)
            elif word == "}":
                open_joints.pop()
                ending = False
            elif word == "OFFSET":
                offset = np.array([float(next(words)) for _ in range(3)])
                if ending:
                    joints[open_joints[-1]].end = offset
                else:
                    joints[-1].offset = offset
            elif word == "CHANNELS":
                joints[-1].channels = [next(words) for _ in range(int(next(words)))]
            elif word == "Frames:":
                frames = int(next(words))
                # Frame Time:
                for _ in range(2):
                    next(words)
                frame_time = float(next(words))
                motion = np.array([float(each) for each in words]).reshape(frames, -1)
                return cls(joints, frame_time, motion)
        raise ValueError(f"{path.name} has no motion.")

    def write(self, path: Path) -> Path:
        """To a file; its path."""
        lines = ["HIERARCHY"]
        self._describe(0, 0, lines)
        lines += ["MOTION", f"Frames: {len(self.motion)}", f"Frame Time: {self.frame_time:.9f}"]
        lines += [" ".join(f"{value:.9f}" for value in row) for row in self.motion]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    def _describe(self, number: int, depth: int, lines: list[str]) -> None:
        joint, indent = self.joints[number], "  " * depth
        said = " ".join(f"{value:.9f}" for value in joint.offset)
        lines += [f"{indent}{'JOINT' if depth else 'ROOT'} {joint.name}", f"{indent}{{"]
        lines += [f"{indent}  OFFSET {said}"]
        lines += [f"{indent}  CHANNELS {len(joint.channels)} {' '.join(joint.channels)}"]
        for child, each in enumerate(self.joints):
            if each.parent == number:
                self._describe(child, depth + 1, lines)
        if joint.end is not None:
            said = " ".join(f"{value:.9f}" for value in joint.end)
            lines += [f"{indent}  End Site", f"{indent}  {{", f"{indent}    OFFSET {said}"]
            lines += [f"{indent}  }}"]
        lines.append(f"{indent}}}")

    def rotations(self) -> Floats:
        """(frames, joints, 3, 3): what the channels say."""
        made = np.broadcast_to(np.eye(3), (len(self.motion), len(self.joints), 3, 3)).copy()
        column = 0
        for number, joint in enumerate(self.joints):
            for channel in joint.channels:
                if channel.endswith("rotation"):
                    turn = about(_AXES[channel[0]], np.radians(self.motion[:, column]))
                    made[:, number] = made[:, number] @ turn
                column += 1
        return made

    def with_rotations(self, rotations: Floats) -> Floats:
        """The motion with rotations put in place of those that the channels say."""
        motion = self.motion.copy()
        column = 0
        for number, joint in enumerate(self.joints):
            turning = [
                column + place
                for place, channel in enumerate(joint.channels)
                if channel.endswith("rotation")
            ]
            order = [_AXES[joint.channels[each - column][0]] for each in turning]
            if order:
                motion[:, turning] = np.degrees(euler(rotations[:, number], order))
            column += len(joint.channels)
        return motion


def about(axis: int, angles: Floats) -> Floats:
    """(n, 3, 3) rotations about one axis, radians."""
    first, second = [(1, 2), (2, 0), (0, 1)][axis]
    made = np.zeros((len(angles), 3, 3))
    made[:, axis, axis] = 1.0
    made[:, first, first] = made[:, second, second] = np.cos(angles)
    made[:, second, first], made[:, first, second] = np.sin(angles), -np.sin(angles)
    return made


def euler(rotations: Floats, order: Sequence[int]) -> Floats:
    """(n, 3) angles whose rotations, one after the other, make these; of three different axes."""
    i, j, k = order
    sign = 1.0 if (i, j, k) in {(0, 1, 2), (1, 2, 0), (2, 0, 1)} else -1.0
    middle = np.arcsin(np.clip(sign * rotations[:, i, k], -1.0, 1.0))
    first = np.arctan2(-sign * rotations[:, j, k], rotations[:, k, k])
    last = np.arctan2(-sign * rotations[:, i, j], rotations[:, i, i])
    return np.stack([first, middle, last], axis=-1)


def with_rest(clip: Bvh, rest_of: Callable[[Joint, Floats], Floats]) -> Bvh:
    """The clip with other rest rotations.

    Args:
        clip: as it is.
        rest_of: a joint's A, from the joint and the direction (3,) to its first child at rest.
    """
    constants = []
    for number, joint in enumerate(clip.joints):
        children = [each.offset for each in clip.joints if each.parent == number]
        along = joint.end if joint.end is not None and not children else None
        direction = (
            along
            if along is not None
            else next(
                (each for each in children if np.linalg.norm(each) > 1e-6),
                np.array([0.0, 1.0, 0.0]),
            )
        )
        constants.append(rest_of(joint, direction / max(np.linalg.norm(direction), 1e-12)))
    said = clip.rotations()
    joints = []
    for number, joint in enumerate(clip.joints):
        above = constants[joint.parent] if joint.parent >= 0 else np.eye(3)
        said[:, number] = above.T @ said[:, number] @ constants[number]
        end = None if joint.end is None else constants[number].T @ joint.end
        joints.append(Joint(joint.name, joint.parent, above.T @ joint.offset, joint.channels, end))
    made = Bvh(joints, clip.frame_time, clip.motion)
    return Bvh(joints, clip.frame_time, made.with_rotations(said))


def along_x(joint: Joint, direction: Floats) -> Floats:
    """All bones along ±X at rest, the left leg opposite to the right: no pose at all."""
    left = joint.name.lower().startswith(("l", "left"))
    return _from_to(np.array([-1.0 if left else 1.0, 0.0, 0.0]), direction)


def leaning(degrees: float) -> Callable[[Joint, Floats], Floats]:
    """At rest the whole person leans forward (to +Z of the file, that has Y up) by so much."""

    def rest_of(joint: Joint, direction: Floats) -> Floats:  # noqa: ARG001
        return about(0, np.array([-np.radians(degrees)]))[0]

    return rest_of


def hanging(joint: Joint, direction: Floats) -> Floats:
    """Arms that hang at rest, of files that have them stretched out."""
    name = joint.name.lower()
    if any(word in name for word in ("shldr", "arm", "elbow", "wrist", "hand")):
        return _from_to(np.array([0.0, -1.0, 0.0]), direction)
    return np.eye(3)


def arms_lowered(degrees: float, elbows: float = 0.0) -> Callable[[Joint, Floats], Floats]:
    """Arms that rest lower than the file has them, stretched along X, and are bent to the front."""

    def rest_of(joint: Joint, direction: Floats) -> Floats:  # noqa: ARG001
        name = joint.name.lower()
        if not any(word in name for word in ("shldr", "arm", "elbow", "hand")):
            return np.eye(3)
        side = 1.0 if name.startswith("l") else -1.0
        turn = about(2, np.array([-side * np.radians(degrees)]))[0]
        if "shldr" not in name:
            turn = turn @ about(1, np.array([-side * np.radians(elbows)]))[0]
        return turn.T

    return rest_of


def anyhow(seed: int) -> Callable[[Joint, Floats], Floats]:
    """Each joint with a rotation of its own, without rhyme or reason."""
    generator = np.random.default_rng(seed)

    def rest_of(joint: Joint, direction: Floats) -> Floats:  # noqa: ARG001
        w, x, y, z = (each := generator.normal(size=4)) / np.linalg.norm(each)
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )

    return rest_of


def _from_to(first: Floats, second: Floats) -> Floats:
    """(3, 3) the smallest rotation from one direction to another."""
    axis, cosine = np.cross(first, second), float(first @ second)
    if cosine < -1.0 + 1e-9:
        other = np.array([0.0, 1.0, 0.0])
        return 2.0 * np.outer(other, other) - np.eye(3)
    skew = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + skew + skew @ skew / (1.0 + cosine)
