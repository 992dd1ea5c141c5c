# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel says of a session of posing, as the simulation takes it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any, Final

import bpy
import numpy as np

from ...blender.rig import (
    Puppet,
    armature_data,
    bone_materials,
    is_part_of,
    set_bone_material,
)
from ...blender.scene import Company, read_obstacle
from ...core.posing.puppet import Elements, Figure, JointCoefficients, Material, elements_for
from ...core.posing.session import Session
from ...core.posing.solver import Obstacle, Plane
from .properties import marked_obstacles, posing_settings

CUSTOM: Final = "CUSTOM"

CUSTOM_NAMES: Final = (
    *("material", "custom_yields", "custom_bears", "custom_springs"),
    *("custom_settles", "custom_gives"),
)
"""The settings that hold it."""

GRAVITY: Final = (0.0, 0.0, -9.81)
_CALMING: Final = 3.0
"""1/s: how fast a free puppet without weight comes to rest."""


_FOLLOWED: Final = (
    *CUSTOM_NAMES,
    *("strength", "root", "gravity", "floor", "floor_height", "use_obstacles"),
    *("self_collision", "friction"),
    *("mirror", "balance", "trails", "onion", "onion_step"),
)


class SessionSettings(SimpleNamespace):
    """The settings that may be changed in the panel while a session goes on, by their names."""

    @classmethod
    def of(cls, armature: bpy.types.Object) -> SessionSettings:
        settings = posing_settings(armature)
        return cls(**{name: getattr(settings, name) for name in _FOLLOWED})

    @property
    def joints(self) -> tuple[Any, float]:
        """What decides on the joints."""
        return chosen_material(self), self.strength

    @property
    def ground(self) -> tuple[bool, float, bool]:
        """What decides on obstacles."""
        return self.floor, self.floor_height, self.use_obstacles

    @property
    def world(self) -> dict[str, Any]:
        """What decides on the world, by names of ``WorldSettings``."""
        calm = self.root == "FREE" and not self.gravity
        return {
            "gravity": GRAVITY if self.gravity else (0.0, 0.0, 0.0),
            "self_collision": self.self_collision,
            "friction": self.friction,
            "drag": _CALMING if calm else 0.0,
        }

    def elements(self, figure: Figure, own: Mapping[int, Material | JointCoefficients]) -> Elements:
        """Of the joints; some bodies may have a material of their own."""
        return elements_for(figure, *self.joints, own=own)

    def obstacles(self, company: Company, scene: bpy.types.Scene) -> list[Obstacle]:
        """What the puppet can touch, shapes of what it can push about among them.

        Raises:
            RigError: an obstacle is damaged.
        """
        unit, armatures = company.rig.unit, company.armatures()
        loose = {each.found() for each in company.things}
        obstacles: list[Obstacle] = []
        if self.floor:
            obstacles.append(Plane(position=np.array([0.0, 0.0, self.floor_height * unit])))
        marked = marked_obstacles(scene) if self.use_obstacles else []
        obstacles += [
            read_obstacle(item, kind, unit)
            for item, kind in marked
            if item not in loose and not any(is_part_of(item, each) for each in armatures)
        ]
        return obstacles + company.shapes()

    def hold_root(self, puppet: Puppet, session: Session, first: int = 0) -> None:
        """Pin a puppet's roots, or free those that nothing locks; its bodies begin with a first."""
        pose, figure = puppet.armature().pose, puppet.figure
        assert pose is not None
        for body, parent in enumerate(figure.parents):
            if parent < 0:
                locked = all(np.array(pose.bones[figure.names[body]].lock_location))
                free = self.root == "FREE" and not locked
                session.pin(first + body, state=not free, firm=self.root == "HELD")


class BoneMaterials:
    """Materials of single joints, and what was measured in a session, to be taken back."""

    def __init__(self, puppet: Puppet) -> None:
        self._puppet = puppet
        self._before: list[Callable[[bpy.types.Object], None]] = []
        self.read()

    def read(self) -> None:
        own = bone_materials(self._puppet.armature())
        names = self._puppet.figure.names
        self.by_body = {body: own[name] for body, name in enumerate(names) if name in own}

    def take(self, material: Material | JointCoefficients, bone: str) -> None:
        """Let the figure, or one bone's joint, be of a material, or this one of coefficients.

        Raises:
            WriteError: the bones are linked.
        """
        armature = self._puppet.armature()
        settings: Any = posing_settings(armature)
        self._before.append(kept_before(armature, settings, bone))
        keep_material(armature, settings, material, bone)
        self.read()

    def take_back(self, armature: bpy.types.Object) -> None:
        for put_back in reversed(self._before):
            put_back(armature)


def joints_of_now(puppet: Puppet) -> Elements:
    """The elements that a session of an armature would have now."""
    settings = SessionSettings.of(puppet.armature())
    return settings.elements(puppet.figure, BoneMaterials(puppet).by_body)


def chosen_material(settings: Any) -> str | Material:
    """What a figure is made of, for ``elements_for``, by settings or the like."""
    if settings.material != CUSTOM:
        return settings.material.lower()
    yields = settings.custom_yields
    return Material(
        bears=settings.custom_bears if yields else float(np.inf),
        springs=settings.custom_springs,
        settles=settings.custom_settles,
        gives=settings.custom_gives if yields else 0.0,
    )


def keep_material(
    armature: bpy.types.Object, settings: Any, material: Material | JointCoefficients, bone: str
) -> None:
    """Make the figure of a material, or with the name of a bone that one's joint, or its joint of
    coefficients.

    Raises:
        WriteError: the bones are linked.
    """
    if bone or isinstance(material, JointCoefficients):
        set_bone_material(armature, bone, material)
        return
    settings.material = CUSTOM
    settings.custom_yields = bool(np.isfinite(material.bears))
    if settings.custom_yields:
        settings.custom_bears = material.bears
        settings.custom_gives = material.gives
    settings.custom_springs = material.springs
    settings.custom_settles = material.settles


def kept_before(
    armature: bpy.types.Object, settings: Any, bone: str
) -> Callable[[bpy.types.Object], None]:
    """What puts back the armature's material of now; asked for before ``keep_material``."""
    values = {each: getattr(settings, each) for each in CUSTOM_NAMES}
    own = bone_materials(armature).get(bone)

    def put_back(armature: bpy.types.Object) -> None:
        if bone:
            if bone in armature_data(armature).bones:
                set_bone_material(armature, bone, own)
            return
        now = posing_settings(armature)
        for each, value in values.items():
            setattr(now, each, value)

    return put_back
