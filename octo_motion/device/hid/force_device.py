# SPDX-License-Identifier: GPL-3.0-or-later
"""Driver of force devices that speak the open HID profile."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress

from ...core.errors import DeviceError
from ...core.rotations.scalars import ZERO, Vector
from ..driver import Description, DeviceLostError, Driver, Kind, Sample, numbered_buttons
from . import force_profile as profile
from .system import Found, Handle, HidReports, claim, open_device


def is_force_device(found: Found) -> bool:
    """Whether an interface says that it follows the profile."""
    return (found.page, found.usage) == (profile.USAGE_PAGE, profile.USAGE)


class ForceDevice(Driver):
    """One force device."""

    def __init__(
        self,
        found: Found,
        handle: Handle,
        features: profile.ForceFeatures,
        set_free: Callable[[], None] = lambda: None,
    ) -> None:
        super().__init__(
            Description(
                name=found.name or "Force device",
                identity=found.identity,
                lasting=found.lasting,
                kind=Kind.POSE,
                buttons=numbered_buttons(features.buttons),
                dynamics=features.dynamics,
            )
        )
        self._sequence = 0
        self._set_free = set_free
        self._reports = HidReports(handle, self.description.name)

    @classmethod
    def open(cls, found: Found) -> ForceDevice:
        """Open a device that was found, and ask what it can do.

        Raises:
            DeviceError: the system does not let us, another Blender has it, or the device follows
                another version.
        """
        handle = open_device(found)
        try:
            set_free = claim(found)
        except DeviceError:
            handle.close()
            raise
        try:
            size = profile.SIZES[profile.FEATURES]
            report = bytes(handle.get_feature_report(profile.FEATURES, size))
            features = profile.parse_features(report)
        except (OSError, ValueError) as error:
            handle.close()
            set_free()
            raise DeviceError(
                f"{found.name or 'The force device'} does not follow the profile: {error}.",
                f"Its firmware must follow version {profile.VERSION} of the profile.",
            ) from error
        return cls(found, handle, features, set_free)

    def read(self) -> Sample | None:
        """The newest pose; None where none came, or only damaged ones.

        Raises:
            DeviceLostError: it was unplugged.
        """
        for report in reversed(self._reports.read()):
            with suppress(profile.ReportError):
                return profile.parse_state(report, time.perf_counter())
        return None

    def send(self, force: Vector, torque: Vector) -> None:
        """Ask for a force; the device's own watchdog ends it where no other follows.

        Raises:
            DeviceLostError: it was unplugged.
        """
        self._sequence += 1
        self._reports.write(profile.pack_command(self._sequence, force, torque))

    def close(self) -> None:
        """Take force away and let the device go."""
        with suppress(DeviceLostError, profile.ReportError):
            self.send(ZERO, ZERO)
        self._reports.close()
        set_free, self._set_free = self._set_free, lambda: None
        set_free()
