# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual: a chapter for each panel and operator, in the sources and in the zip alike."""

from __future__ import annotations

import re
import runpy
from fnmatch import fnmatchcase
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import bpy
import pytest

from octo_motion.ui import manual, preferences, registration
from octo_motion.ui.panel_base import TabPanel
from tests.ui.rig import make_octopus

ROOT = Path(__file__).resolve().parent.parent.parent
PAGES = runpy.run_path(str(ROOT / ".ci" / "manual.py"))


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    texts = {name: ROOT / "docs" / f"{name}.md" for name in PAGES["PAGES"]}
    return {name: PAGES["page"](path.read_text(encoding="utf-8")) for name, path in texts.items()}


def test_each_panel_has_a_chapter(pages: dict[str, str]) -> None:
    panels = [each for each in registration.CLASSES if issubclass(each, TabPanel)]
    names = {each.__name__.removeprefix("OCTO_MOTION_PT_") for each in panels}
    assert names == manual.CHAPTERS.keys()
    chapters = {*manual.CHAPTERS.values(), *(chapter for _, chapter in manual.PAGES)}
    for chapter in chapters - {"device"}:
        assert f'id="{chapter}"' in pages["guide"], chapter


def test_links_between_the_pages_lead_somewhere(pages: dict[str, str]) -> None:
    for name, text in pages.items():
        for link in re.findall(r'href="([^"]+)"', text):
            page, _, place = link.partition("#")
            if page.startswith("http"):
                continue
            other = pages[page.removesuffix(".html")] if page else text
            assert not place or f'id="{place}"' in other, f"{name}: {link}"
        for picture in re.findall(r'<img [^>]*src="([^"]+)"', text):
            assert (ROOT / "docs" / picture).is_file(), f"{name}: {picture}"


def test_no_mark_of_the_source_is_left_on_a_page(pages: dict[str, str]) -> None:
    for name, text in pages.items():
        plain = re.sub(
            r"<pre>.*?</pre>|<code>.*?</code>|<style>.*?</style>", "", text, flags=re.DOTALL
        )
        assert not re.findall(r"\*\*|\]\(|^#|^\|", plain, flags=re.MULTILINE), name


def test_the_online_manual_of_a_right_click_finds_settings_and_operators() -> None:
    begins, patterns = manual.manual_map()
    assert begins.startswith("file://")

    def found(name: str) -> str:
        return next(page for pattern, page in patterns if fnmatchcase(name.lower(), pattern))

    assert found("bpy.ops.octo_motion.splice_drag_timing").endswith("#timing-of-a-splice")
    assert found("bpy.types.OCTO_MOTION_PG_ground.duty").endswith("#the-ground")
    assert found("bpy.types.OCTO_MOTION_PG_locomotion.speed").endswith("#the-first-walk")
    for each in dir(bpy.ops.octo_motion):
        assert found(f"bpy.ops.octo_motion.{each}")


def test_a_new_creature_begins_as_the_preferences_say(monkeypatch: pytest.MonkeyPatch) -> None:
    own = SimpleNamespace(size=2.0, keys="REDUCED", layer="LAYER", fade_unit="SECONDS", port=0)
    monkeypatch.setattr(preferences, "preferences", lambda: own)
    assert preferences.preferred_size() == 2.0
    bpy.ops.octo_motion.add_octopus(ready=True)
    clicked: Any = bpy.context.object
    assert clicked.octo_motion.locomotion.keys == "REDUCED"
    # What a script makes is the same at every computer.
    plain: Any = make_octopus("Plain")
    assert plain.octo_motion.locomotion.keys == "DENSE"


def test_messages_can_stay_english_in_a_blender_that_speaks_another_language() -> None:
    said: list[str] = []

    class Layout:
        use_property_split = True

        def column(self, **_: str) -> Layout:
            return self

        row = column

        def prop(self, _owner: Any, name: str, **_: Any) -> None:
            said.append(name)

        def operator(self, *_: str, **_more: str) -> None: ...

    own = SimpleNamespace(layout=Layout())
    preferences.OCTO_MOTION_AP_preferences.draw(cast("Any", own), bpy.context)
    assert "use_translate_reports" in said
    assert "use_translate_reports" in bpy.types.PreferencesView.bl_rna.properties


def test_without_a_window_preferences_count_for_nothing() -> None:
    assert bpy.app.background
    assert preferences.preferences() is None
    assert preferences.preferred_size() == 1.0
