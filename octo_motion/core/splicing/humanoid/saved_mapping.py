# SPDX-License-Identifier: GPL-3.0-or-later
"""Mappings that were saved, one for each kind of skeleton: they recognise the skeletons of their
kind, whatever prefix the bones' names have there and whatever other bones there are.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Final

from ...errors import RigError
from ...phrases import phrase
from .landmarks import LANDMARKS, Landmarks

_FORMAT: Final = "octo_motion.mapping"
_VERSION: Final = 1
_FEWEST: Final = 3
"""Bones that tell a skeleton."""
_REMEDY: Final = "Save the mapping anew, or remove it."

Parents = Mapping[str, str]
"""Name of the parent of each bone, "" of those without."""


@dataclass(frozen=True)
class SavedMapping:
    """Which bone is which on one kind of skeleton."""

    name: str
    parents: Parents
    """Of the bones by which the kind is told: landmarks, and all between them. The one that carries
    all others has none."""
    landmarks: Mapping[str, str]
    """Name of the bone by landmark."""
    further: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    """What else the file says, by key: kept as it is."""

    def on(self, parents: Parents) -> Landmarks | None:
        """The landmarks of a skeleton, given all of its bones; none if it is of another kind.

        Of its kind is what has all bones by which the kind is told, each hanging on the same one,
        with names that are alike behind a prefix of their own: "Bob:Hips" and "Hips".
        """
        shared = _alike(list(self.parents))
        carrier = next(bone for bone, parent in self.parents.items() if not parent)
        ending = carrier[shared:]
        prefixes = [bone.removesuffix(ending) for bone in parents if bone.endswith(ending)]
        own = carrier[:shared]
        for prefix in sorted(prefixes, key=lambda each: each != own):
            if all(
                parents.get(prefix + bone[shared:], "?") == prefix + parent[shared:]
                if parent
                else prefix + bone[shared:] in parents
                for bone, parent in self.parents.items()
            ):
                return Landmarks(
                    {each: prefix + bone[shared:] for each, bone in self.landmarks.items()}
                )
        return None

    def to_json(self) -> str:
        """The file's text."""
        content = {
            **self.further,
            "format": _FORMAT,
            "version": _VERSION,
            "name": self.name,
            "parents": dict(self.parents),
            "landmarks": dict(self.landmarks),
        }
        return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def new_mapping(
    name: str, parents: Parents, landmarks: Landmarks, further: Mapping[str, Any] | None = None
) -> SavedMapping:
    """The mapping of a skeleton, given all of its bones and what its table says.

    Raises:
        RigError: the table is empty or names a bone that is not there, or its bones do not hang
            together.
    """
    chains: list[list[str]] = []
    for bone in landmarks.bones.values():
        if bone not in parents:
            raise RigError(
                phrase("There is no bone '{bone}'.", bone=bone), "Correct the table of landmarks."
            )
        chain = [bone]
        while parents[chain[-1]]:
            chain.append(parents[chain[-1]])
        chains.append(chain[::-1])
    if not chains:
        raise RigError("The table of landmarks is empty.", "Find the landmarks first.")
    shared = _alike(chains)
    if not shared:
        raise RigError(
            "The bones of the table hang on several roots.", "Correct the table of landmarks."
        )
    told = {bone: parents[bone] for chain in chains for bone in chain[shared:]}
    told[chains[0][shared - 1]] = ""
    if len(told) < _FEWEST:
        raise RigError(
            "The table of landmarks has too few bones to tell a skeleton by.", "Fill it first."
        )
    ordered = {bone: told[bone] for bone in parents if bone in told}
    return SavedMapping(name, ordered, dict(landmarks.bones), dict(further or {}))


def mapping_from_json(text: str, name: str) -> SavedMapping:
    """A mapping from its file, with the name of that.

    Raises:
        RigError: it is damaged, or made by a later version.
    """
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise damaged_mapping(name, phrase("it is no JSON")) from error
    if not isinstance(content, dict) or content.get("format") != _FORMAT:
        raise damaged_mapping(name, phrase("it is a file of something else"))
    if content.get("version") != _VERSION:
        raise damaged_mapping(
            name,
            phrase(
                "its version is {version}, not {known}",
                version=content.get("version"),
                known=_VERSION,
            ),
        )
    parents, landmarks = (_names(content, key, name) for key in ("parents", "landmarks"))
    known = {each: bone for each, bone in landmarks.items() if each in LANDMARKS}
    if not known:
        raise damaged_mapping(name, phrase("it has no landmarks"))
    for bone in (*known.values(), *filter(None, parents.values())):
        if bone not in parents:
            raise damaged_mapping(name, phrase("it does not say on what '{bone}' hangs", bone=bone))
    if sum(not parent for parent in parents.values()) != 1:
        raise damaged_mapping(name, phrase("not just one of its bones carries all others"))
    own = {"format", "version", "name", "parents", "landmarks"}
    further = {key: value for key, value in content.items() if key not in own}
    return SavedMapping(name, parents, known, further)


def _alike(rows: Sequence[Sequence[str]]) -> int:
    """How many letters of words, or names of lists, are the same at the beginning of all."""
    columns = list(zip(*rows, strict=False))
    apart = (place for place, column in enumerate(columns) if len(set(column)) > 1)
    return next(apart, len(columns))


def _names(content: Mapping[str, Any], key: str, name: str) -> dict[str, str]:
    names = content.get(key)
    if not isinstance(names, dict) or not all(isinstance(each, str) for each in names.values()):
        raise damaged_mapping(name, phrase("'{key}' is no table of names", key=key))
    return names


def damaged_mapping(name: str, reason: str) -> RigError:
    """The error that says so."""
    return RigError(
        phrase("The saved mapping '{name}' cannot be read: {reason}.", name=name, reason=reason),
        _REMEDY,
    )


def recognised(
    mappings: Sequence[SavedMapping], parents: Parents
) -> tuple[SavedMapping, Landmarks] | None:
    """The mapping of a skeleton's kind with its landmarks there, given all of its bones; of several
    the one that tells its kind by most bones.
    """
    fitting = [(each, marks) for each in mappings if (marks := each.on(parents)) is not None]
    return max(fitting, key=lambda found: len(found[0].parents), default=None)
