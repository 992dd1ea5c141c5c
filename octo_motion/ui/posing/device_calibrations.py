# SPDX-License-Identifier: GPL-3.0-or-later
"""What was learned of devices on this computer: their own zero and range."""

from __future__ import annotations

from ...blender.files import load_calibrations, save_calibrations
from ...core.errors import SettingsError, WriteError
from ...device.calibration import NONE, Calibration
from ...device.ipc import Client
from ...device.messages import CalibrationMessage, DeviceMessage, Notice


class Calibrations:
    """Kept in a file, and handed to devices as they come.

    Args:
        client: to the bridge.
    """

    def __init__(self, client: Client) -> None:
        self._client = client
        self.learned = load_calibrations()
        """By a device's identity."""
        self._sent: dict[int, str] = {}

    def forget_sent(self) -> None:
        """Another bridge knows nothing yet."""
        self._sent = {}

    def reset(self, number: int) -> None:
        """Forget what was learned of a device.

        Raises:
            SettingsError: nothing was.
            WriteError: the file of calibrations cannot be written.
        """
        identity = self._client.devices[number].identity
        if identity not in self.learned:
            raise SettingsError("This device was not calibrated.", "It is as its maker says.")
        left = {name: each for name, each in self._all().items() if name != identity}
        save_calibrations(left)
        self.learned = left
        self._client.send(CalibrationMessage.of(number, NONE))

    def keep_learned(self) -> list[tuple[int, DeviceMessage]]:
        """Keep what devices have learned since the last time; which did."""
        client = self._client
        found = [
            (number, client.devices[number], learned.calibration())
            for number, learned in client.calibrated.items()
            if number in client.devices
        ]
        client.calibrated.clear()
        for _, device, calibration in found:
            self.keep(device, calibration)
        return [(number, device) for number, device, _ in found]

    def keep(self, device: DeviceMessage, calibration: Calibration) -> None:
        """Keep what was learned of a device."""
        self.learned = {**self._all(), device.identity: calibration}
        try:
            save_calibrations(self.learned)
        except WriteError as error:
            # It holds for now all the same.
            self._client.notices.append(Notice(error.problem, error.remedy))

    def send(self) -> None:
        """Tell devices that came what was learned of them."""
        client = self._client
        present = {number: device.identity for number, device in client.devices.items()}
        for number, identity in present.items():
            if self._sent.get(number) != identity:
                # Also where none was learned: another device may have had its number.
                wanted = self.learned.get(identity, NONE)
                client.send(CalibrationMessage.of(number, wanted))
        self._sent = present

    def _all(self) -> dict[str, Calibration]:
        """Those known here, and what another Blender may have learned since they were read."""
        return {**self.learned, **load_calibrations()}
