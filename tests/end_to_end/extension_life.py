# SPDX-License-Identifier: GPL-3.0-or-later
"""One life of the extension, run by test_extension.py in a Blender of its own.

python -m tests.end_to_end.extension_life register
python -m tests.end_to_end.extension_life install ZIP
"""

import importlib
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import bpy

NAME = "bl_ext.user_default.octo_motion"


def traces() -> set[str]:
    """Everything in this Blender that an add-on could have added."""
    return set(list_traces())


def list_traces() -> Iterator[str]:
    for name in dir(bpy.types):
        yield f"class {name}"
        blender_class = getattr(bpy.types, name)
        if rna := getattr(blender_class, "bl_rna", None):
            yield from (f"property {name}.{each.identifier}" for each in rna.properties)
        for function in getattr(getattr(blender_class, "draw", None), "_draw_funcs", ()):
            # Where an entry was ever appended, Blender keeps the menu's own in the same list.
            if function.__qualname__ != f"{name}.draw":
                yield f"menu entry {name}: {function.__module__}.{function.__qualname__}"
    for module in dir(bpy.ops):
        yield from (f"operator {module}.{name}" for name in dir(getattr(bpy.ops, module)))
    for name in dir(bpy.app.handlers):
        if isinstance(functions := getattr(bpy.app.handlers, name), list):
            yield from (f"handler {name}: {function.__module__}" for function in functions)
    for configuration in bpy.context.window_manager.keyconfigs:
        for keymap in configuration.keymaps:
            yield from (f"key {keymap.name}: {item.idname}" for item in keymap.keymap_items)
    yield from (f"add-on {add_on.module}" for add_on in bpy.context.preferences.addons)


def register_twice() -> None:
    import octo_motion

    before = traces()
    for _ in range(2):
        octo_motion.register()
        assert "operator octo_motion.add_octopus" in traces() - before
        octo_motion.unregister()
        assert traces() == before, traces() ^ before


def start_bridge() -> Iterator[str]:
    """Start the installed extension's bridge; what it says, and the extension's own libraries."""
    # The Python of these tests may have another hidapi, which Blender's would not.
    sys.path.sort(key=lambda path: ".local" not in path)
    python = importlib.import_module(f"{NAME}.core.processes.python")
    client = importlib.import_module(f"{NAME}.device.ipc.client").Client()
    client.start(("--simulate", "--no-haply"))
    end = time.monotonic() + 60.0
    while not (client.hello and client.devices) and time.monotonic() < end:
        client.poll()
        time.sleep(0.01)
    # The loop looks for HID devices at once, and would have told that hidapi is missing.
    for _ in range(100):
        client.poll()
        time.sleep(0.01)
    yield "bridge"
    yield from (str(each.name).replace(" ", "-") for each in client.devices.values())
    yield "hidapi-missing" if any("hidapi" in each.problem for each in client.notices) else "hidapi"
    yield from (path for path in python.library_folders() if "extensions" in path)
    client.stop()


def first_walk() -> int:
    """Frames of the walk that a newcomer gets: three clicks."""
    bpy.ops.octo_motion.add_octopus()
    octopus = bpy.context.object
    bpy.ops.octo_motion.add_route()
    assert bpy.ops.octo_motion.generate_locomotion() == {"FINISHED"}
    assert octopus is not None
    data = octopus.animation_data
    assert data is not None
    assert data.action is not None
    return int(data.action.frame_range[1])


def install(archive: str) -> None:
    """Install, disable, enable and uninstall; print operators, bridge and hidapi's file."""
    extensions = Path(bpy.utils.resource_path("USER")) / "extensions"
    before = traces()

    bpy.ops.extensions.package_install_files(
        filepath=archive, repo="user_default", enable_on_install=True
    )
    installed = traces()
    print(*dir(bpy.ops.octo_motion))
    print(f"walk {first_walk()}")
    print(*start_bridge())
    print(*(path.name for path in (extensions / ".local" / "lib").rglob("hid.*")))

    bpy.ops.preferences.addon_disable(module=NAME)
    assert traces() == before, traces() ^ before
    bpy.ops.preferences.addon_enable(module=NAME)
    assert traces() == installed, traces() ^ installed

    bpy.ops.extensions.package_uninstall(
        repo_directory=str(extensions / "user_default"), pkg_id="octo_motion"
    )
    assert traces() == before, traces() ^ before
    assert not (extensions / "user_default" / "octo_motion").exists()


if __name__ == "__main__":
    {"register": register_twice, "install": install}[sys.argv[1]](*sys.argv[2:])
