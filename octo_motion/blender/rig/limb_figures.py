# SPDX-License-Identifier: GPL-3.0-or-later
"""Single bones of an armature as bodies: how long, how thick, how heavy they are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Final

import bpy
import numpy as np

from ...core.errors import RigError
from ...core.phrases import phrase
from ...core.posing.puppet import SIZE, Figure, Roles, build_figure, diagonal
from ...core.rotations import Floats
from .armature import armature_data, even_scale, read_skeleton
from .puppet_reading import posed_bones, skin_points

_LEAST: Final = 0.02
"""Of the figure's size: shorter bones of the rest of the body are nothing to touch."""

_INSIDE: Final = 60.0
"""Of a hundred points of the skin: what of a bone that follows is within its capsule, …"""
_SURFACE: Final = 85.0
"""… and of what it is to stay outside of."""


def figure_unit(armature: bpy.types.Object) -> float:
    """Metres of a figure of the usual size that one metre in the world is.

    Raises:
        RigError: the armature has no bones, no size, or an uneven scale.
    """
    skeleton = read_skeleton(armature)
    size = diagonal(skeleton.heads, skeleton.tails) * even_scale(armature)
    if not size > 0.0:
        raise RigError(
            phrase("'{name}' has no size.", name=armature.name), "Repair its bones or its scale."
        )
    return SIZE / size


@contextmanager
def _at_rest(armature: bpy.types.Object) -> Iterator[None]:
    """The armature in its rest position for a while: limbs are as thick whatever it does just now.

    Linked data cannot be put there; it is read as it stands.
    """
    data = armature_data(armature)
    before, layer = data.pose_position, bpy.context.view_layer
    if before == "REST" or not data.is_editable or layer is None:
        yield
        return
    data.pose_position = "REST"
    layer.update()
    try:
        yield
    finally:
        data.pose_position = before
        layer.update()


class LimbReader:
    """Bones of one armature at rest, where it stands, in metres of a figure of the usual size.

    Raises:
        RigError: it has no bones, no size, or an uneven scale.
    """

    def __init__(self, armature: bpy.types.Object) -> None:
        self.skeleton = read_skeleton(armature)
        self.unit = figure_unit(armature)
        with _at_rest(armature):
            posed = posed_bones(armature, even_scale(armature), self.skeleton)
            skin = skin_points(armature, self.skeleton)
        self._posed = replace(
            posed, heads=posed.heads * self.unit, lengths=posed.lengths * self.unit
        )
        self._skin = {bone: points * self.unit for bone, points in skin.items()}

    def figure(
        self, bones: Sequence[int], parents: Sequence[int], thick: float = _INSIDE
    ) -> Figure:
        """Bones as bodies, each on its parent among them (−1 for none), without any strength; so
        many of a hundred points of their skin are within.
        """
        skeleton = self.skeleton
        own = {bone: number for number, bone in enumerate(bones)}
        follows = tuple(own.get(bone, -1) for bone in range(len(skeleton)))
        roles = Roles(tuple(bones), tuple(parents), tuple(parents), follows)
        figure, _ = build_figure(skeleton, roles, self._posed, skin=self._skin, thick=thick)
        return figure

    def rest_of_body(self, bones: Sequence[int]) -> tuple[tuple[int, ...], Floats, Floats]:
        """The other bones as capsules: which, their ends (capsules, 2, 3) in the bones' frames and
        their radii (capsules,).

        Those that hang on ``bones`` go with them, and count for nothing.
        """
        skeleton = self.skeleton
        gone = set(bones)
        for bone, parent in enumerate(skeleton.parents):
            if parent in gone:
                gone.add(bone)
        least = _LEAST * SIZE
        some_skin = bool(self._skin)
        solid = [
            bone
            for bone in range(len(skeleton))
            if bone not in gone
            and self._posed.lengths[bone] > least
            and (bone in self._skin if some_skin else skeleton.deform[bone])
        ]
        if not solid:
            return (), np.zeros((0, 2, 3)), np.zeros(0)
        figure = self.figure(solid, [-1] * len(solid), _SURFACE)
        return tuple(solid), figure.capsules, figure.radii
