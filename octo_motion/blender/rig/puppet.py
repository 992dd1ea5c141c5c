# SPDX-License-Identifier: GPL-3.0-or-later
"""A puppet's pose to and from an armature's bones, each in its own rotation mode.

Nothing of Blender's is held between calls: only names, and numbers that were read at the start.
"""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np
from mathutils import Quaternion, Vector

from ...core.errors import RigError
from ...core.phrases import phrase
from ...core.posing.puppet import Figure, Pose
from ...core.rotations import Floats, conjugate, from_matrix, multiply, rotate
from .armature import carrying_axes, even_scale, set_rotation
from .puppet_reading import PuppetRig, posed_bones, read_rig

_NOTHING = 1e-9
"""Factor below which a bone is scaled to nothing."""
_STILL = 1e-6
"""Quaternion components and puppet metres by which a body may be off its bone unnoticed."""


class Puppet:
    """A local armature in the hands of a session, whatever it is called meanwhile."""

    def __init__(self, armature: bpy.types.Object, rig: PuppetRig | None = None) -> None:
        self.name = armature.name
        self._number = armature.session_uid
        self.rig = rig or read_rig(armature)
        self._bones = armature_bones(armature)
        # What the bones show already is not written: their own values stay exactly as they are.
        self._written: Pose | None = self.rig.pose
        self._set_frames(armature)

    @property
    def figure(self) -> Figure:
        return self.rig.figure

    def armature(self) -> bpy.types.Object:
        """The armature object, as it is now.

        Raises:
            RigError: it is gone, or its bones are others.
        """
        found = self.found()
        if armature_bones(found) != self._bones:
            raise RigError(
                phrase("The bones of '{name}' have changed.", name=self.name), "Start posing again."
            )
        return found

    def found(self) -> bpy.types.Object:
        """The armature object, whatever its bones are by now.

        Raises:
            RigError: it is gone.
        """
        found = bpy.data.objects.get((self.name, None))
        if found is None or found.session_uid != self._number:
            everything = (each for each in bpy.data.objects if each.session_uid == self._number)
            found = next(everything, None)
        if found is None or found.pose is None:
            raise RigError(
                phrase("'{name}' is gone.", name=self.name),
                "Start posing again with another armature.",
            )
        self.name = found.name
        return found

    def read(self) -> Pose:
        """Where the bodies are, as the armature is shown now; it goes on from there."""
        self._written = self._shown()
        return self._written

    def _shown(self) -> Pose:
        armature = self.armature()
        posed = posed_bones(armature, even_scale(armature), self.rig.skeleton)
        bodies = list(self.rig.roles.bodies)
        return Pose(posed.heads[bodies] * self.rig.unit, posed.rotations[bodies])

    def write(self, pose: Pose) -> list[str]:
        """Give bones the pose; the names of those whose values have changed."""
        armature = self.armature()
        assert armature.pose is not None
        rotations, locations = self._local(armature, pose)
        moved = self._moved(pose)
        changed: list[str] = []
        names = self.figure.names
        for body in np.flatnonzero(moved).tolist():
            bone = armature.pose.bones[names[body]]
            set_rotation(bone, Quaternion(rotations[body].tolist()))
            if self._places[body]:
                place = Vector(locations[body].tolist())
                if not bone.bone.use_local_location:
                    place = carrying_axes(bone.bone) @ place
                bone.location = place
            changed.append(bone.name)
        self._written = pose
        return changed

    def local(self, pose: Pose) -> tuple[Floats, Floats]:
        """A pose as rotations (bodies, 4) from rest and locations (bodies, 3) in the rest frame."""
        return self._local(self.armature(), pose)

    def forget(self) -> None:
        """Something else has posed the armature: the next pose is written whole.

        What carries the limbs may have been posed as well, a root bone that travels.
        """
        self._written = None
        self._set_frames(self.armature())

    def is_moved(self) -> bool:
        """Whether the armature object has been moved since ``forget``, or the start."""
        return not np.array_equal(np.array(self.armature().matrix_world), self._world)

    def settle(self) -> str:
        """See to it that the bones show the pose that was written; what cannot be, in words."""
        return ""

    def shown_for(self, pose: Pose) -> Pose | None:  # noqa: ARG002
        """What is shown in place of a pose that was settled and could not be, from where it goes
        on; none where it is shown.
        """
        return None

    def keyed(self, bodies: Iterable[int], *, all_bones: bool = False) -> list[tuple[str, bool]]:  # noqa: ARG002
        """Bones that get keys for bodies, and whether they are placed as well as turned."""
        return [(self.figure.names[body], self.places(body)) for body in bodies]

    def leading(self) -> list[bpy.types.Object]:
        """Objects through which limbs are posed, as bones that are controls are.

        Raises:
            RigError: one is gone.
        """
        return []

    def keyed_objects(
        self,
        bodies: Iterable[int],  # noqa: ARG002
        *,
        all_bones: bool = False,  # noqa: ARG002
    ) -> list[bpy.types.Object]:
        """Those of them that get keys for bodies.

        Raises:
            RigError: one is gone.
        """
        return []

    def places(self, body: int) -> bool:
        """Whether a body's bone is placed by its location too, not only turned."""
        return bool(self._places[body])

    def with_followers(self, bodies: Iterable[int]) -> list[int]:
        """Bodies that were turned, and those whose bones have other values because of it.

        A bone that does not inherit rotation, or hangs on a limb by its place alone, does not go
        along with it by itself.
        """
        turned = set(bodies)
        parents = self.figure.parents
        for body, carrier in enumerate(self._carriers.tolist()):
            until = -1 if self._free_turn[body] else carrier
            above = parents[body]
            while above not in {-1, until} and body not in turned:
                if above in turned:
                    turned.add(body)
                above = parents[above]
        return sorted(turned)

    def _moved(self, pose: Pose) -> np.ndarray:
        """Bodies whose bones have to be written: those that are turned against their carrier."""
        count = len(self.figure)
        if self._written is None:
            return np.ones(count, dtype=bool)
        before, after = self._written, pose
        carriers = np.where(self._free_turn, -1, self._carriers)
        turned = np.abs(_seen(carriers, before) - _seen(carriers, after)).max(axis=1)
        shifted = np.abs(before.positions - after.positions).max(axis=1)
        return (turned > _STILL) | (self._places & (shifted > _STILL))

    def _set_frames(self, armature: bpy.types.Object) -> None:
        """How each bone's rest frame rides on the body that carries it."""
        rig = self.rig
        bones = list(rig.roles.bodies)
        self._carriers = np.array(rig.roles.carriers)
        self._world = np.array(armature.matrix_world)
        object_turn = _object_turn(armature)
        posed = posed_bones(armature, even_scale(armature), self.rig.skeleton)
        turned = multiply(conjugate(object_turn), posed.rotations)
        heads = self._to_armature(armature, posed.heads * rig.unit)
        rest, rest_heads = rig.skeleton.rest_rotations, rig.skeleton.heads
        sizes = posed.lengths / np.maximum(rig.skeleton.lengths, 1e-12)
        sizes /= even_scale(armature)

        # Carried by the bones that they hang on in Blender, …
        above = np.array(rig.skeleton.parents)[bones]
        hangs = above >= 0
        above = above[hangs]
        turn, place = rest[bones], rest_heads[bones]
        carry = multiply(turned[above], conjugate(rest[above]))
        way = rotate(carry, place[hangs] - rest_heads[above])
        turn[hangs] = multiply(carry, turn[hangs])
        place[hangs] = heads[above] + sizes[above, None] * way
        self._sizes = np.ones(len(bones))
        self._sizes[hangs] = sizes[above]
        # … seen from the bodies that carry those.
        rides = self._carriers >= 0
        base = np.array(bones)[self._carriers[rides]]
        back = conjugate(turned[base])
        turn[rides] = multiply(back, turn[rides])
        place[rides] = rotate(back, place[rides] - heads[base])
        self._turns, self._offsets = turn, place
        self._free_turn = ~np.array(rig.skeleton.inherits_rotation)[bones]
        # What is scaled to nothing cannot be moved.
        self._sizes[self._sizes < _NOTHING] = 1.0
        parents = np.array(rig.roles.parents)
        connected = np.array([rig.skeleton.connected[bone] for bone in bones])
        self._places = ((parents < 0) | (parents != self._carriers)) & ~connected

    def _local(self, armature: bpy.types.Object, pose: Pose) -> tuple[Floats, Floats]:
        """Rotations (bodies, 4) and locations (bodies, 3) in the bones' own rest frames."""
        turned = multiply(conjugate(_object_turn(armature)), pose.orientations)
        heads = self._to_armature(armature, pose.positions)
        carried, place = self._turns.copy(), self._offsets.copy()
        rides = self._carriers >= 0
        base = self._carriers[rides]
        carried[rides] = multiply(turned[base], self._turns[rides])
        place[rides] = heads[base] + rotate(turned[base], self._offsets[rides])
        along = rotate(conjugate(carried), heads - place) / self._sizes[:, None]
        bones = list(self.rig.roles.bodies)
        rest = self.rig.skeleton.rest_rotations[bones]
        carried = np.where(self._free_turn[:, None], rest, carried)
        return multiply(conjugate(carried), turned), along

    def _to_armature(self, armature: bpy.types.Object, positions: Floats) -> Floats:
        """Puppet metres in the world (…, 3) to the armature's own space."""
        world = np.array(armature.matrix_world, dtype=np.float64)
        inverse = np.linalg.inv(world)
        return (positions / self.rig.unit) @ inverse[:3, :3].T + inverse[:3, 3]


def armature_bones(armature: bpy.types.Object) -> tuple[str, ...]:
    """Names of an armature's bones in their order."""
    data = armature.data
    return tuple(bone.name for bone in data.bones) if isinstance(data, bpy.types.Armature) else ()


def _object_turn(armature: bpy.types.Object) -> Floats:
    axes = np.array(armature.matrix_world, dtype=np.float64)[:3, :3]
    return from_matrix(axes / np.linalg.norm(axes, axis=0))


def _seen(carriers: np.ndarray, pose: Pose) -> Floats:
    """Orientations (bodies, 4) seen from the bodies that carry them, signs made alike."""
    seen = pose.orientations.copy()
    rides = carriers >= 0
    seen[rides] = multiply(conjugate(pose.orientations[carriers[rides]]), pose.orientations[rides])
    return np.where(seen[:, :1] < 0.0, -seen, seen)
