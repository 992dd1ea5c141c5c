# SPDX-License-Identifier: GPL-3.0-or-later
"""What a library override may change of our properties."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from bpy.stub_internal.rna_enums import (
        PropertyOverrideFlagCollectionItems,
        PropertyOverrideFlagItems,
    )

OVERRIDE: Final[set[PropertyOverrideFlagItems]] = {"LIBRARY_OVERRIDABLE"}

OVERRIDE_LIST: Final[set[PropertyOverrideFlagCollectionItems]] = {
    "LIBRARY_OVERRIDABLE",
    "USE_INSERTION",
}
