# SPDX-License-Identifier: GPL-3.0-or-later
"""A hand on mouse and keyboard of Blender's window, and an eye on it.

Blender draws and takes events only between two steps of a script: what must wait is a generator
that yields the seconds until it is to go on. It runs inside Blender, beside the installed extension
and not beside the sources.
"""

from __future__ import annotations

import shutil
import subprocess
import time
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import bpy
from bpy_extras.view3d_utils import location_3d_to_region_2d

Steps = Generator[float, None, None]
PAUSE = 0.05
PATIENCE = 60.0
_KEYS = {" ": "SPACE", ".": "PERIOD", "-": "MINUS", ":": "SEMI_COLON", "'": "QUOTE"}
_DIGITS = ("ZERO", "ONE", "TWO", "THREE", "FOUR", "FIVE", "SIX", "SEVEN", "EIGHT", "NINE")


class HandError(Exception):
    """What was looked for is not there; one sentence says what."""


class Hand:
    """One hand."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.clicks = 0
        self.wheel = 0
        self.draws: list[float] = []
        """When the viewport was drawn, s."""
        self._place = (400, 400)
        view: Any = bpy.types.SpaceView3D
        view.draw_handler_add(self._drawn, (), "WINDOW", "POST_PIXEL")

    def _drawn(self) -> None:
        self.draws.append(time.perf_counter())

    @property
    def window(self) -> Any:
        return bpy.context.window_manager.windows[0]

    def area(self, kind: str = "VIEW_3D") -> Any:
        return next(each for each in self.window.screen.areas if each.type == kind)

    def region(self, kind: str = "WINDOW", area: str = "VIEW_3D") -> Any:
        return next(each for each in self.area(area).regions if each.type == kind)

    def event(self, kind: str, value: str, **more: Any) -> None:
        x, y = self._place
        self.window.event_simulate(type=kind, value=value, x=x, y=y, **more)

    def move(self, x: float, y: float) -> Steps:
        """Move the mouse to a pixel of the window."""
        self._place = (round(x), round(y))
        self.event("MOUSEMOVE", "NOTHING")
        yield PAUSE

    def over(self, kind: str = "WINDOW") -> Steps:
        """Move it to the middle of a region of the viewport."""
        region = self.region(kind)
        yield from self.move(region.x + region.width // 2, region.y + region.height // 2)

    def click(self, button: str = "LEFTMOUSE", **held: bool) -> Steps:
        self.clicks += 1
        for value in ("PRESS", "RELEASE"):
            self.event(button, value, **held)
            yield PAUSE
        yield from self.settled()

    def key(self, key: str, **held: bool) -> Steps:
        """Press a key and let it go."""
        for value in ("PRESS", "RELEASE"):
            self.event(key, value, **held)
            yield PAUSE
        yield from self.settled()

    def type(self, text: str) -> Steps:
        """Type words; a letter that has no key of its own comes as an input method sends it."""
        for each in text:
            name = _KEYS.get(each) or (_DIGITS[int(each)] if each in "0123456789" else each.upper())
            name = name if each.isascii() else "A"
            self.event(name, "PRESS", unicode=each, shift=each.isupper())
            self.event(name, "RELEASE")
            yield PAUSE

    def search(self, words: str) -> Steps:
        """Call what the menu search finds first for words, said in the language that is shown."""
        yield from self.over()
        yield from self.key("F3")
        yield 0.5
        yield from self.type(bpy.app.translations.pgettext_iface(words, "Operator"))
        yield 1.0
        yield from self.key("RET")
        yield 0.3

    def settled(self) -> Steps:
        """Wait until Blender has drawn the viewport once more."""
        before, begun = len(self.draws), time.perf_counter()
        self.redraw()
        while len(self.draws) == before and time.perf_counter() - begun < 5.0:
            yield PAUSE

    def redraw(self) -> None:
        for area in self.window.screen.areas:
            area.tag_redraw()

    def until(self, condition: Callable[[], bool], what: str) -> Steps:
        """Wait for something."""
        begun = time.perf_counter()
        while not condition():
            if time.perf_counter() - begun > PATIENCE:
                raise HandError(f"{what} has not come.")
            yield PAUSE

    def pixel(self, point: Any) -> tuple[float, float]:
        """Where in the window a point of the world is seen."""
        region, data = self.region(), self.area().spaces.active.region_3d
        seen = location_3d_to_region_2d(region, data, point)
        if seen is None:
            raise HandError("It is not in sight.")
        return region.x + seen[0], region.y + seen[1]

    # --- The sidebar ----------------------------------------------------------------------------

    def show_tab(self) -> Steps:
        """Open the sidebar at the extension's tab."""
        self.area().spaces.active.show_region_ui = True
        yield from self.settled()
        yield 0.5
        self.region("UI").active_panel_category = "Octo Motion"
        yield from self.settled()
        yield 0.5

    def find(self, wanted: str) -> Steps:
        """Move the mouse onto the button of the sidebar that does this, from top to bottom.

        What a button does is what Blender's own Copy Python Command and Copy Data Path say.
        """
        region = self.region("UI")
        for share in (0.5, 0.25, 0.8):
            for down in range(10, region.height - 8, 14):
                yield from self.move(
                    region.x + share * region.width, region.y + region.height - down
                )
                yield PAUSE
                if wanted in self._button():
                    return
        raise HandError(f"There is no button '{wanted}' in sight.")

    def _button(self) -> str:
        manager = bpy.context.window_manager
        manager.clipboard = ""
        with bpy.context.temp_override(
            window=self.window, area=self.area(), region=self.region("UI")
        ):
            for name in ("copy_python_command_button", "copy_data_path_button"):
                call = getattr(bpy.ops.ui, name)
                try:
                    if call.poll():
                        call()
                except RuntimeError:
                    continue
        return manager.clipboard

    def press(self, wanted: str) -> Steps:
        """Click the button of the sidebar that does this."""
        yield from self.find(wanted)
        yield from self.click()

    # --- Pictures -------------------------------------------------------------------------------

    def take(self, name: str) -> Steps:
        """Keep a picture of the window."""
        yield from self.settled()
        yield 0.3
        path = self.folder / f"{name}.png"
        with bpy.context.temp_override(window=self.window):
            bpy.ops.screen.screenshot(filepath=str(path), check_existing=False)
        image: Any = bpy.data.images.load(str(path))
        black = max(image.pixels[:4000:4]) == 0.0 and max(image.pixels[-40000::4]) == 0.0
        bpy.data.images.remove(image)
        if black and shutil.which("import"):
            # OpenGL without a graphics card has drawn, but lets nobody read what is shown.
            subprocess.run(["import", "-window", "root", str(path)], check=False)
