# SPDX-License-Identifier: GPL-3.0-or-later
"""How saved_0_1_0.blend and saved_0_1_0.json were made, by Octo Motion 0.1.0 in Blender 4.5.

    PYTHONPATH=<Octo Motion 0.1.0> python tests/data/make_saved_0_1_0.py <folder>

with bpy 4.5: an octopus without mesh, of which every setting differs from its default and every
list has two items, and what those settings then were. Made once; not run again.
"""

import json
import sys
from pathlib import Path
from typing import Any

import bpy

import octo_motion
from octo_motion.ui.declared_settings import plain

# What is worked out when it is read, and what would begin to work when the file is opened.
COMPUTED = frozenset({"as_text"})
# These load a gait or make a curve when they are set; the rest must be there by then.
LAST = ("gait", "use_weight_curve")


def _other_number(definition: Any) -> float:
    """A number within the bounds that is not the default."""
    low, high = definition.soft_min, definition.soft_max
    if definition.type == "INT":
        return definition.default + 1 if definition.default < high else definition.default - 1
    low, high = max(low, definition.default - 1.0), min(high, definition.default + 1.0)
    other = low + 0.375 * (high - low)
    return other if abs(other - definition.default) > 1e-3 else low + 0.625 * (high - low)


def _change(group: Any, data: dict[str, Any], name: str) -> None:
    definition = group.bl_rna.properties[name]
    if definition.type == "COLLECTION":
        for number in range(2):
            item = getattr(group, name).add()
            change_all(item, data)
            item.name = f"{name} {number}"
    elif definition.type == "POINTER":
        if definition.fixed_type.identifier in data:
            setattr(group, name, data[definition.fixed_type.identifier])
            if getattr(group, name) is None:
                setattr(group, name, data["Mesh object"])
        else:
            change_all(getattr(group, name), data)
    elif getattr(definition, "is_array", False):
        other = [0.125 * (number + 1) for number in range(definition.array_length)]
        setattr(group, name, other)
    elif definition.type == "BOOLEAN":
        setattr(group, name, not definition.default)
    elif definition.type == "ENUM":
        others = [each.identifier for each in definition.enum_items]
        setattr(group, name, next(each for each in others if each != definition.default))
    elif definition.type == "STRING":
        setattr(group, name, f"another {name}")
    else:
        setattr(group, name, _other_number(definition))


def change_all(group: Any, data: dict[str, Any]) -> None:
    """Give every property of a group, and of those within it, another value than its default."""
    names = [
        each.identifier
        for each in group.bl_rna.properties
        if each.identifier not in {"rna_type", *COMPUTED} and not each.is_readonly
    ]
    names += [
        each.identifier
        for each in group.bl_rna.properties
        if each.is_readonly
        and each.type in {"POINTER", "COLLECTION"}
        and each.identifier != "rna_type"
    ]
    for name in sorted(names, key=lambda each: each in LAST):
        _change(group, data, name)


def main(folder: Path) -> None:
    """Make both files."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    octo_motion.register()
    bpy.ops.octo_motion.add_octopus(with_mesh=False, arms=4, joints=4)
    armature: Any = bpy.context.object
    curve = bpy.data.objects.new("Route", bpy.data.curves.new("Route", "CURVE"))
    mesh = bpy.data.objects.new("Ground", bpy.data.meshes.new("Ground"))
    marker: Any = bpy.data.objects.new("Marker", None)
    for each in (curve, mesh, marker):
        bpy.context.scene.collection.objects.link(each)
    action = bpy.data.actions.new("Generated")
    action.use_fake_user = True
    data: dict[str, Any] = {"Object": curve, "Action": action, "Mesh object": mesh}
    data["NodeTree"] = bpy.data.node_groups.new("Weights", "ShaderNodeTree")
    own = armature.octo_motion
    change_all(own.locomotion, data)
    own.locomotion.ground.object = mesh
    for reach in own.locomotion.reaches:
        reach.target = mesh
    for number, splice in enumerate(own.splicing.splices):
        splice.source = armature
        splice.slot = f"slot {number}"
    change_all(own.splicing, data)
    change_all(own.posing, data)
    change_all(marker.octo_motion.contact, data)
    told = {each.name: plain(each.octo_motion) for each in (armature, marker)}
    (folder / "saved_0_1_0.json").write_text(
        json.dumps(told, indent=1, sort_keys=True) + "\n", encoding="utf-8"
    )
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "saved_0_1_0.blend"), compress=True)
    octo_motion.unregister()


main(Path(sys.argv[1]).resolve())
