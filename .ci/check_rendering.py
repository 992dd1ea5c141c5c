# SPDX-License-Identifier: GPL-3.0-or-later
"""Say in one sentence what to install where Blender cannot render without a screen.

Without a working EGL, Blender's first picture ends the whole process with a crash that names no
cause. So one pixel is rendered in a process of its own.
"""

import subprocess
import sys

ONE_PIXEL = """
import bpy
render = bpy.context.scene.render
render.engine = "BLENDER_WORKBENCH"
render.resolution_x = render.resolution_y = 1
bpy.ops.render.render()
"""

trial = subprocess.run(  # noqa: S603 - our own Python and the lines above
    [sys.executable, "-c", ONE_PIXEL], capture_output=True, encoding="utf-8", check=False
)
if trial.returncode != 0:
    last_words = (trial.stderr.strip().splitlines() or [f"status {trial.returncode}"])[-1]
    sys.exit(
        f"Blender cannot start or render on this machine ({last_words}): install its system "
        "libraries and a software OpenGL, on Debian and Ubuntu with "
        "`apt-get install libegl1 libgl1 libgl1-mesa-dri libsm6 libxi6 libxkbcommon0 libxrender1`."
    )
