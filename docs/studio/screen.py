# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's own window: a 3D viewport with the tab Octo Motion in it, and pictures of that.

Blender draws, and lays out its areas, only between two steps of a script. So whatever must wait for
it is a generator, which yields the seconds until it is to go on; see ``window.py``.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Collection, Generator
from pathlib import Path
from typing import Any, Final

import bpy
import numpy as np
import stage
from bpy_extras import view3d_utils
from mathutils import Quaternion, Vector
from stage import Pixels, Points

from octo_motion.ui import registration
from octo_motion.ui.panel_base import TabPanel

Steps = Generator[float, None, None]

PANELS: Final[dict[str, Any]] = {
    each.__name__.removeprefix("OCTO_MOTION_PT_"): each
    for each in registration.CLASSES
    if issubclass(each, TabPanel)
}
"""All panels of the tab by short names, in the order in which they are registered."""

_PAUSE: Final = 0.1
"""s between two looks at whether Blender has drawn."""
_PATIENCE: Final = 300
"""Looks, after which it never will."""
_BORDER: Final = 5
"""Pixels at an area's edge, where its round corners are."""
_BESIDE: Final = 24
"""Pixels at its left edge, where the arrow of the hidden toolbar is."""
_HEADERS: Final = 70
"""Pixels: more than the viewport's two headers are high."""
_LEAST_AREA: Final = 120
"""Pixels: an area that is smaller is not worth a split."""
_TABS: Final = 22
"""Pixels: the width of the tabs beside the panels."""
_BEFORE: Final = 10
"""Pixels: how far from the sidebar's edge the panels begin."""


class WindowError(Exception):
    """A picture cannot be taken; one sentence says why and what to do."""


class Screen:
    """One 3D viewport beside nothing else, its sidebar open at the tab.

    Attributes:
        size: of the pictures (width, height), pixels; the height is that of the panels, if it is
            not given.

    Args:
        width: of the pictures.
        height: likewise.
        header: whether the viewport's header is in them.
        left: pixels that the viewport goes on at their left, which moves its middle there.
    """

    def __init__(
        self, width: int, height: int | None = None, *, header: bool = False, left: int = 0
    ) -> None:
        self.size = (width, height)
        self._header = header
        self._left = left
        self._drawn = 0
        self._mouse = np.zeros(2)

    def open(self, opened: Collection[str], present: Collection[str] | None = None) -> Steps:
        """Begin with Blender's own new file, without its objects.

        Args:
            opened: names of the panels that are open.
            present: names of those that are there at all; without, all are.
        """
        register_panels(opened, PANELS if present is None else present)
        bpy.ops.wm.read_homefile(use_factory_startup=True)
        _set_preferences()
        yield _PAUSE
        for each in list(bpy.data.objects):
            bpy.data.objects.remove(each)
        stage.the_scene().render.dither_intensity = 0.0
        yield from self._make_room()
        space = self.space
        space.show_region_ui = True
        space.show_region_toolbar = False
        space.show_region_tool_header = not self._header
        space.overlay.show_text = False
        space.shading.color_type = "MATERIAL"
        view: Any = bpy.types.SpaceView3D
        view.draw_handler_add(self._count, (), "WINDOW", "POST_PIXEL")
        yield from self.drawn()

    def _show_tab(self) -> Steps:
        # Blender knows the tabs of a sidebar when it has drawn them once.
        yield from self.drawn()
        self.region("UI").active_panel_category = TabPanel.bl_category
        yield from self.drawn()

    def _count(self) -> None:
        self._drawn += 1

    def _make_room(self) -> Steps:
        window = the_window()
        close: Any = bpy.ops.screen.area_close
        while len(window.screen.areas) > 1:
            before = len(window.screen.areas)
            for area in window.screen.areas:
                with bpy.context.temp_override(window=window, area=area):
                    if area.type != "VIEW_3D" and close.poll():
                        close()
                        break
            yield _PAUSE
            if len(window.screen.areas) == before:
                raise WindowError("Blender does not close the areas beside the 3D viewport.")
        wanted = self.size[0] + max(self._left, _BESIDE) + _BORDER
        whole = window.screen.areas[0]
        if whole.width < wanted:
            raise WindowError(
                f"The window is {whole.width} pixels wide, and {wanted} are needed: "
                "use a larger screen."
            )
        yield from self._split("VERTICAL", whole.width, wanted)
        if self.size[1] is not None:
            yield from self._split("HORIZONTAL", whole.height, self.size[1] + _HEADERS)

    def _split(self, direction: Any, there: int, wanted: int) -> Steps:
        """Leave the viewport so many pixels at the right or at the top, if there are more."""
        if there - wanted < _LEAST_AREA:
            return
        window, whole = the_window(), self.area
        with bpy.context.temp_override(window=window, area=whole):
            bpy.ops.screen.area_split(direction=direction, factor=1.0 - wanted / there)
        yield 3.0 * _PAUSE
        halves = [each for each in window.screen.areas if each.type == "VIEW_3D"]
        min(halves, key=lambda each: (each.x, each.y)).type = "INFO"
        yield _PAUSE

    @property
    def area(self) -> bpy.types.Area:
        """The viewport."""
        return next(each for each in the_window().screen.areas if each.type == "VIEW_3D")

    @property
    def space(self) -> Any:
        """What the viewport shows, and how."""
        return self.area.spaces.active

    def region(self, kind: str = "WINDOW") -> bpy.types.Region:
        """One of the viewport's regions."""
        return next(each for each in self.area.regions if each.type == kind)

    def override(self) -> Any:
        """For operators that are called as if the mouse were in the viewport."""
        return bpy.context.temp_override(
            window=the_window(), area=self.area, region=self.region("WINDOW")
        )

    def drawn(self) -> Steps:
        """Wait until Blender has drawn the viewport twice: panels find their size by drawing."""
        for _ in range(2):
            before = self._drawn
            for area in the_window().screen.areas:
                area.tag_redraw()
            for _ in range(_PATIENCE):
                yield _PAUSE
                if self._drawn > before:
                    break
            else:
                raise WindowError("Blender does not draw its window: is it hidden?")

    def until(self, condition: Callable[[], bool], what: str) -> Steps:
        """Wait for what goes on in Blender.

        Args:
            condition: whether it has come.
            what: is waited for, to say so if it never comes.
        """
        for _ in range(_PATIENCE):
            if condition():
                return
            yield _PAUSE
        raise WindowError(f"{what} has not come: try again.")

    # --- Where the camera is --------------------------------------------------------------------

    def look(self, view: Quaternion, points: Points, *, margin: float = 0.05) -> Steps:
        """See all points, in the part of the picture that the sidebar leaves free.

        Args:
            view: rotation of the view.
            points: (n, 3) world.
            margin: left free at each side, as a share of the free part.
        """
        data = self.space.region_3d
        data.view_rotation = view
        data.view_location = Vector(points.mean(axis=0).tolist())
        yield from self._show_tab()
        height = yield from self._height()
        low, high = self._free(height)
        low, high = low + margin * (high - low), high - margin * (high - low)
        for _ in range(12):
            seen = self.pixels_of(points)
            least, most = seen.min(axis=0), seen.max(axis=0)
            self._move(0.5 * (least + most), 0.5 * (low + high))
            data.view_distance *= float(np.max((most - least) / (high - low)))
            data.update()
        yield from self.drawn()

    def _free(self, height: int) -> tuple[Points, Points]:
        """Opposite corners of what the sidebar leaves free of the picture, in the region."""
        window, sidebar = self.region("WINDOW"), self.region("UI")
        right = float(sidebar.x - window.x)
        left = window.width - _BORDER - self.size[0]
        top = self._top() - window.y
        return np.array([left, top - height], dtype=float), np.array([right, top], dtype=float)

    def _move(self, start: Points, end: Points) -> None:
        """Let what is seen at one pixel be seen at another one."""
        data, region = self.space.region_3d, self.region("WINDOW")
        there, here = (
            view3d_utils.region_2d_to_location_3d(region, data, each.tolist(), data.view_location)
            for each in (start, end)
        )
        data.view_location += there - here
        data.update()

    def pixels_of(self, points: Points) -> Points:
        """(n, 2) pixels of the region where points (n, 3) of the world are seen."""
        region = self.region("WINDOW")
        matrix = np.array(self.space.region_3d.perspective_matrix, dtype=np.float64)
        seen = points @ matrix[:, :3].T + matrix[:, 3]
        size = np.array([region.width, region.height], dtype=np.float64)
        return 0.5 * size * (1.0 + seen[:, :2] / seen[:, 3:])

    # --- Mouse and keys -------------------------------------------------------------------------

    def drag(self, start: Points, end: Points, seconds: float = 2.0) -> Steps:
        """Press the mouse at a pixel of the region, and move it to another one, still pressed."""
        yield from self._point(start)
        self._event("LEFTMOUSE", "PRESS", start)
        yield _PAUSE
        count = round(seconds / _PAUSE)
        for number in range(1, count + 1):
            yield from self._point(start + number / count * (end - start))
        yield seconds

    def press(self, key: str) -> Steps:
        """Press a key and let it go, wherever the mouse was last."""
        for value in ("PRESS", "RELEASE"):
            self._event(key, value, self._mouse)
            yield _PAUSE

    def _point(self, place: Points) -> Steps:
        self._mouse = place
        self._event("MOUSEMOVE", "NOTHING", place)
        yield _PAUSE

    def _event(self, kind: Any, value: Any, place: Points) -> None:
        region = self.region("WINDOW")
        x, y = (round(float(each)) for each in place)
        the_window().event_simulate(kind, value, x=region.x + x, y=region.y + y)

    # --- Pictures -------------------------------------------------------------------------------

    def take(self) -> Generator[float, None, Pixels]:
        """The picture: the viewport's upper right corner."""
        height = yield from self._height()
        yield from self.drawn()
        return self._corner(self.size[0], height)

    def take_moment(self) -> Pixels:
        """The picture of what goes on, at once: of something that draws itself all the time."""
        width, height = self.size
        assert height is not None
        return self._corner(width, height)

    def take_panels(self) -> Generator[float, None, Pixels]:
        """A picture of the panels alone, without the tabs beside them."""
        yield from self._show_tab()
        height = yield from self._bottom()
        return self._corner(self.region("UI").width, height)[:, _BEFORE:-_TABS]

    def _height(self) -> Generator[float, None, int]:
        if self.size[1] is None:
            self.size = (self.size[0], (yield from self._bottom()))
        height = self.size[1]
        assert height is not None
        self._check_height(height)
        return height

    def _bottom(self) -> Generator[float, None, int]:
        """How far the panels reach down, pixels."""
        overlay = self.space.overlay
        overlay.show_overlays = False
        yield from self.drawn()
        sidebar = self._corner(self.region("UI").width, self._room())
        overlay.show_overlays = True
        yield from self.drawn()
        # Where panels have a margin at their right, so that nothing else shows there.
        column = sidebar[:, -_TABS - 8 : -_TABS - 4]
        # Panels that reach further down than the window leave nothing of the view below them.
        background = sidebar[-1, _BEFORE // 2]
        other = np.flatnonzero(np.any(np.abs(column - background) > 0.01, axis=(1, 2)))
        bottom = int(other[-1]) + _BORDER
        self._check_height(bottom)
        return bottom

    def _check_height(self, height: int) -> None:
        there = self._room()
        if height >= there:
            raise WindowError(
                f"The picture is more than {there} pixels high, which is all that the window has: "
                "use a larger screen."
            )

    def _room(self) -> int:
        """Pixels from the picture's upper edge to the area's lower one."""
        return self._top() - self.area.y - _BORDER

    def _top(self) -> int:
        """Pixels of the window below the picture's upper edge."""
        area, sidebar = self.area, self.region("UI")
        return area.y + area.height - _BORDER if self._header else sidebar.y + sidebar.height

    def _corner(self, width: int, height: int) -> Pixels:
        """(height, width, 3) the viewport's upper right corner."""
        whole = screenshot()
        right = self.area.x + self.area.width - _BORDER
        top = whole.shape[0] - self._top()
        return whole[top : top + height, right - width : right]


def the_window() -> bpy.types.Window:
    """Blender's first window."""
    manager = bpy.context.window_manager
    assert manager is not None
    return manager.windows[0]


def register_panels(opened: Collection[str], present: Collection[str]) -> None:
    """Register panels anew: in a new screen they are open or closed as they say themselves.

    Args:
        opened: names of those that are open.
        present: names of those that are there at all.
    """
    if unknown := {*opened, *present} - set(PANELS):
        raise ValueError(f"There is no panel called {unknown.pop()}.")
    for panel in reversed(PANELS.values()):
        if panel.is_registered:
            bpy.utils.unregister_class(panel)
    for name, panel in PANELS.items():
        if "HIDE_HEADER" not in getattr(panel, "bl_options", ()):
            panel.bl_options = set() if name in opened else {"DEFAULT_CLOSED"}
        if name in present:
            bpy.utils.register_class(panel)


def _set_preferences() -> None:
    """One pixel of the picture for one of Blender's units, whatever screen this is."""
    preferences = bpy.context.preferences
    assert preferences is not None
    view, system = preferences.view, preferences.system
    assert view is not None
    assert system is not None
    view.smooth_view = 0
    view.show_splash = False
    view.ui_scale = view.ui_scale / system.ui_scale


def screenshot() -> Pixels:
    """(height, width, 3) the window, from the top row down."""
    window = the_window()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "window.png"
        with bpy.context.temp_override(window=window):
            bpy.ops.screen.screenshot(filepath=str(path), check_existing=False)
        pixels = _loaded(path)
        if not pixels.any() and shutil.which("import"):
            # OpenGL without a graphics card has drawn, but lets nobody read what is shown.
            subprocess.run(["import", "-window", "root", str(path)], check=False)
            pixels = _loaded(path)
    if not pixels.any() or pixels.shape[:2] != (window.height, window.width):
        raise WindowError(
            "Blender cannot read what its window shows: install ImageMagick, or run "
            '`make window BLENDER="blender --gpu-backend vulkan"`.'
        )
    return pixels


def _loaded(path: Path) -> Pixels:
    image: Any = bpy.data.images.load(str(path))
    width, height = image.size
    pixels = np.empty(width * height * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)[::-1, :, :3]
