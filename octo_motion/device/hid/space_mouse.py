# SPDX-License-Identifier: GPL-3.0-or-later
"""Driver of space mice: push the cap, and the pointer moves."""

from __future__ import annotations

import time
from typing import Final

from ...core.rotations.scalars import Vector
from ..driver import Description, Driver, Kind, Sample, numbered_buttons
from .descriptor import DescriptorError, ReportLayout, parse_descriptor
from .models import USAGE, USAGE_PAGE, model_of
from .multi_axis import MultiAxis, classic_layout
from .system import Found, Handle, HidReports, descriptor_of, open_device

_SILENCE: Final = 0.5
"""s: a pushed cap reports every 8 to 16 ms; after so long it is out of reach, not held still."""


def is_space_mouse(found: Found) -> bool:
    """Whether an interface says that it is a multi-axis controller.

    Where the system tells no usage (usage page 0), the table of products decides.
    """
    if found.page == 0:
        return model_of(found.vendor, found.product) is not None
    return (found.page, found.usage) == (USAGE_PAGE, USAGE)


class SpaceMouse(Driver):
    """One space mouse."""

    def __init__(self, found: Found, handle: Handle, layout: ReportLayout) -> None:
        model = model_of(found.vendor, found.product)
        names = model.buttons if model else {}
        buttons = numbered_buttons(max(names, default=1) + 1)
        super().__init__(
            Description(
                name=model.name if model else found.name or "Space mouse",
                identity=found.identity,
                lasting=found.lasting,
                kind=Kind.RATE,
                buttons=tuple(names.get(bit, name) for bit, name in enumerate(buttons)),
            )
        )
        self._axes = MultiAxis(layout)
        self._last_report = 0.0
        self._reports = HidReports(handle, self.description.name)

    @classmethod
    def open(cls, found: Found) -> SpaceMouse:
        """Open a device that was found.

        Raises:
            DeviceError: the system does not let us.
        """
        handle = open_device(found)
        layout = None
        descriptor = descriptor_of(handle)
        if descriptor:
            try:
                layout = parse_descriptor(descriptor)
            except DescriptorError:
                layout = None  # as if the system had not told it
        if layout is None or not MultiAxis(layout).useful:
            model = model_of(found.vendor, found.product)
            layout = classic_layout(combined=bool(model and model.combined))
        return cls(found, handle, layout)

    def read(self) -> Sample | None:
        """The newest state, all waiting reports taken in.

        Raises:
            DeviceLostError: it was unplugged.
        """
        reports = self._reports.read()
        now = time.perf_counter()
        known = [self._axes.feed(report) for report in reports]
        if any(known):
            self._last_report = now
        # At rest a device is silent; a push that nobody repeats is one that got lost.
        silent = now - self._last_report > _SILENCE
        push = None if silent else self._axes.push
        return Sample(now, buttons=self._axes.buttons, push=push)

    def send(self, force: Vector, torque: Vector) -> None:
        """Nothing: a space mouse has no motors."""

    def close(self) -> None:
        """Let the device go."""
        self._reports.close()
