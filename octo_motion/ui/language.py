# SPDX-License-Identifier: GPL-3.0-or-later
"""What people read, in the language that Blender is set to.

There is a catalogue for each language in the folder ``languages``: the English texts, and what they
are in that language, by the context in which Blender asks for them. What is registered, and what
layouts draw as it stands in the source, Blender looks up by itself; all else comes here on its way
out.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

import bpy

from ..core import phrases

FOLDER: Final = Path(__file__).resolve().parent.parent / "languages"
ANYWHERE: Final = "*"
"""Blender's context of all texts …"""
OPERATOR: Final = "Operator"
"""… but the labels of operators and of their buttons."""
OWN: Final = "Octo Motion"
"""Context of our settings and panels. In the others Blender's own words come first: there "Arm" is
short for an armature, and "Root" is said as a route is."""

Texts = dict[str, str]
Catalogue = dict[str, Texts]
"""Texts by context. What stands in that of operators alone is what is said otherwise there."""


def languages() -> dict[str, Path]:
    """The catalogues, by Blender's identifier of their language."""
    return {path.stem: path for path in sorted(FOLDER.glob("*.json"))}


def read_catalogue(path: Path) -> Catalogue:
    """A language's texts."""
    return json.loads(path.read_text(encoding="utf-8"))


def blender_texts(catalogue: Catalogue) -> dict[tuple[str, str], str]:
    """A catalogue as Blender takes it: it looks for a text in one context alone."""
    everywhere = catalogue.get(ANYWHERE, {})
    contexts = {ANYWHERE: {}, OPERATOR: {}, OWN: {}} | catalogue
    return {
        (context, english): said
        for context, texts in contexts.items()
        for english, said in (everywhere | texts).items()
    }


def translated(text: object) -> str:
    """A text, a phrase or an error for panels, menus, headers and the status bar."""
    return phrases.told(text, lambda english: bpy.app.translations.pgettext_iface(english, OWN))


def reported(text: object) -> str:
    """The same for Blender's reports."""
    return phrases.told(text, lambda english: bpy.app.translations.pgettext_rpt(english, OWN))


def hinted(text: object) -> str:
    """The same for tooltips."""
    return phrases.told(text, lambda english: bpy.app.translations.pgettext_tip(english, OWN))


def register() -> None:
    """Make the catalogues known to Blender."""
    found = {each: blender_texts(read_catalogue(path)) for each, path in languages().items()}
    bpy.app.translations.register(__package__, found)


def unregister() -> None:
    """Take them away."""
    bpy.app.translations.unregister(__package__)
