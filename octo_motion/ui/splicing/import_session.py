# SPDX-License-Identifier: GPL-3.0-or-later
"""Several motion files, one after the other, all of them or none."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import bpy

from ...blender.scene import ImportedClip, Up, import_clip, remove_clips
from ...core.errors import ClipError


class ImportSession:
    """An import that can be stopped between files, and taken back.

    Args:
        paths: the files; one that is named twice is imported once.
        frame_start: frame of the first key of each.
        context: of the import; not kept.
        up: which axis of BVH files points up.

    Raises:
        ClipError: there are no files.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        frame_start: int,
        context: bpy.types.Context,
        *,
        up: Up = "AUTO",
    ) -> None:
        self._paths = list(dict.fromkeys(paths))
        if not self._paths:
            raise ClipError("No file is given.", "Choose one or more.")
        self.clips: list[ImportedClip] = []
        self.refused: list[tuple[Path, ClipError]] = []
        self._frame_start = frame_start
        self._up: Up = up
        layer = context.view_layer
        assert layer is not None
        self._selected = [
            each.name_full for each in layer.objects if each.select_get(view_layer=layer)
        ]
        self._active = layer.objects.active.name_full if layer.objects.active else ""

    @property
    def told(self) -> str:
        """The file whose turn it is, for people."""
        number = len(self.clips) + len(self.refused)
        path = self._paths[min(number, len(self._paths) - 1)]
        return f"'{path.name}' ({min(number + 1, len(self._paths))} of {len(self._paths)})"

    def steps(self, progress: Callable[[float], None] = lambda _: None) -> Iterator[float]:
        """Import them file by file; yields the share of the work that is done.

        Args:
            progress: is told the same more often.
        """
        for number, path in enumerate(self._paths):

            def told(share: float, number: int = number) -> None:
                progress((number + share) / len(self._paths))

            try:
                clip = import_clip(path, bpy.context, self._frame_start, up=self._up, progress=told)
                self.clips.append(clip)
            except ClipError as error:
                self.refused.append((path, error))
            yield (number + 1) / len(self._paths)

    def end(self) -> ImportSession:
        """Leave the new armatures selected, the first one active, as importers do.

        Raises:
            ClipError: not one of the files was imported.
        """
        if not self.clips:
            path, error = self.refused[0]
            more = f" {len(self.refused) - 1} more were refused." if len(self.refused) > 1 else ""
            raise ClipError(f"'{path.name}' was not imported. {error.problem}", error.remedy + more)
        _select([name for clip in self.clips for name in clip.armatures])
        return self

    def undo(self) -> None:
        """Take back what was imported so far."""
        remove_clips(self.clips)
        self.clips.clear()
        _select(self._selected, self._active)


def _select(names: Sequence[str], active: str | None = None) -> None:
    """Select objects, and make one of them active, the first that is there if none is named."""
    layer = bpy.context.view_layer
    assert layer is not None
    # What was just removed is in the layer's list until the next update.
    layer.update()
    # A collection that is switched off in this view layer hides its objects.
    shown = {each.name_full: each for each in layer.objects}
    for name, each in shown.items():
        each.select_set(state=name in names, view_layer=layer)
    if active is None:
        active = next((name for name in names if name in shown), "")
    layer.objects.active = shown.get(active)
