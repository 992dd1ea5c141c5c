# SPDX-License-Identifier: GPL-3.0-or-later
"""The classes of the add-on, in the order in which Blender must learn of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy

from . import at_work, settings, splicing
from .locomotion import panels
from .locomotion.operators import (
    add_octopus,
    add_route,
    contacts,
    gait_table,
    generate,
    live,
    setups,
)
from .locomotion.operators import arms as arm_list
from .locomotion.operators import changes as change_list
from .locomotion.operators import reaches as reach_list
from .locomotion.settings import changes as change_properties
from .locomotion.settings import gait as gait_properties
from .locomotion.settings import ground as ground_properties
from .locomotion.settings import properties
from .locomotion.settings import quality as quality_report
from .locomotion.settings import reaches as reach_properties
from .posing import (
    device_calibrate,
    device_panel,
    device_pose,
    device_settings,
    marks,
    measure,
    pose_start,
)
from .posing import panels as posing_panels
from .posing import properties as posing_properties
from .posing import registration as posing
from .posing import script_player as pose_script

Draw = Callable[[bpy.types.Menu, bpy.types.Context], None]

MENUS: tuple[tuple[Any, Draw], ...] = (
    (bpy.types.VIEW3D_MT_armature_add, add_octopus.draw_in_add_menu),
    (bpy.types.VIEW3D_MT_curve_add, add_route.draw_in_add_menu),
    (bpy.types.TOPBAR_MT_file_import, splicing.draw_in_import_menu),
)

CLASSES: tuple[type, ...] = (
    *gait_properties.CLASSES,
    *arm_list.CLASSES,
    *reach_properties.CLASSES,
    *ground_properties.CLASSES,
    *change_properties.CLASSES,
    *quality_report.CLASSES,
    *properties.CLASSES,
    *splicing.SETTINGS,
    *posing_properties.CLASSES,
    *device_settings.CLASSES,
    *settings.CLASSES,
    add_octopus.OCTO_MOTION_OT_add_octopus,
    add_route.OCTO_MOTION_OT_add_route,
    *gait_table.CLASSES,
    generate.OCTO_MOTION_OT_generate_locomotion,
    *contacts.CLASSES,
    *setups.CLASSES,
    *change_list.CLASSES,
    *quality_report.OPERATORS,
    *reach_list.CLASSES,
    *panels.CLASSES,
    *splicing.CLASSES,
    *pose_start.CLASSES,
    *pose_script.CLASSES,
    *marks.CLASSES,
    *measure.CLASSES,
    *posing_panels.CLASSES,
    *device_pose.CLASSES,
    *device_calibrate.CLASSES,
    *device_panel.CLASSES,
)


def register() -> None:
    """Register all classes and menus; an error surfaces."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    settings.register()
    live.register()
    device_settings.register()
    setups.register()
    for menu, draw in MENUS:
        menu.append(draw)


def unregister() -> None:
    """Take back what ``register`` did, in reverse order."""
    at_work.stop_all()
    posing.unregister()
    device_settings.unregister()
    for menu, draw in reversed(MENUS):
        menu.remove(draw)
    setups.unregister()
    live.unregister()
    settings.unregister()
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
