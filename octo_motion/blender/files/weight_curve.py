# SPDX-License-Identifier: GPL-3.0-or-later
"""A curve that an artist draws, kept where Blender has a widget for it: in a node.

Add-ons cannot have curve properties of their own. A node group with a single Float Curve node
can be pointed to, saved and drawn.
"""

from __future__ import annotations

from typing import Any, Final

import bpy
import numpy as np

from ...core.errors import SettingsError
from ...core.rotations import Floats

NAME: Final = ".Octo Motion Joint Weights"
"""The leading full stop hides the node group from menus."""

NODE: Final = "Weights"


def ensure_weight_curve(
    group: bpy.types.NodeTree | None, root: float, tip: float
) -> bpy.types.NodeTree:
    """The node group given, if it has the curve and can be edited; else a new one.

    A new curve begins with the values of root and tip at its left and right end.
    """
    made: Any  # the stubs say that all of it may be None
    if group is not None and group.is_editable and curve_node(group) is not None:
        return group
    if group is not None and curve_node(group) is not None:
        # Linked from another file: one's own copy can be drawn on.
        made = group.copy()
        return made
    made = bpy.data.node_groups.new(NAME, "ShaderNodeTree")
    node = made.nodes.new("ShaderNodeFloatCurve")
    node.name = NODE
    points = node.mapping.curves[0].points
    points[0].location, points[-1].location = (0.0, root), (1.0, tip)
    node.mapping.update()
    return made


def curve_node(group: bpy.types.NodeTree) -> bpy.types.Node | None:
    """The node that has the curve, its ``mapping``."""
    node = group.nodes.get(NODE)
    return node if node is not None and node.bl_idname == "ShaderNodeFloatCurve" else None


def sample_weight_curve(group: bpy.types.NodeTree | None, count: int) -> Floats:
    """Values of the curve at ``count`` even steps from its left end to its right one.

    Raises:
        SettingsError: there is no such curve.
    """
    node = curve_node(group) if group is not None else None
    if node is None:
        raise SettingsError(
            "The curve of the joint weights is gone.", "Switch the curve off and on again."
        )
    mapping: Any = node.mapping  # type: ignore[attr-defined]
    mapping.initialize()
    curve = mapping.curves[0]
    return np.array([mapping.evaluate(curve, place) for place in np.linspace(0.0, 1.0, count)])
