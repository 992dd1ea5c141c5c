# SPDX-License-Identifier: GPL-3.0-or-later
"""What was learned of the user's devices: one file for this computer, whatever is opened."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any, Final

from ...core.errors import DeviceError
from ...device.calibration import Calibration
from ...device.driver import Axes
from .user_files import own_folder, write_whole

log = logging.getLogger(__name__)

_FORMAT: Final = "octo_motion.devices"
_VERSION: Final = 1
_AXES: Final = ("rest", "least", "most")


def _path(*, create: bool = False) -> Path:
    return own_folder("devices", create=create) / "calibrations.json"


def load_calibrations() -> dict[str, Calibration]:
    """By a device's identity. What is damaged counts as never learned, and is said in the log."""
    path = _path()
    try:
        data: Any = json.loads(path.read_text(encoding="utf-8"))
        entries: Any = data["devices"] if data["format"] == _FORMAT else {}
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        log.warning("Calibrations of devices cannot be read: %s", error)
        return {}
    found: dict[str, Calibration] = {}
    for identity, entry in entries.items() if isinstance(entries, dict) else ():
        try:
            found[identity] = Calibration(*(_six(entry[name]) for name in _AXES))
        except (ValueError, KeyError, TypeError, DeviceError) as error:
            log.warning("The calibration of %s cannot be read: %s", identity, error)
    return found


def _six(values: Any) -> Axes:
    a, b, c, d, e, f = map(float, values)
    return (a, b, c, d, e, f)


def save_calibrations(calibrations: dict[str, Calibration]) -> None:
    """Keep these, and no others.

    Raises:
        WriteError: the file cannot be written.
    """
    devices = {
        identity: {name: getattr(each, name) for name in _AXES}
        for identity, each in sorted(calibrations.items())
    }
    text = json.dumps({"format": _FORMAT, "version": _VERSION, "devices": devices}, indent=1)
    write_whole(_path(create=True), text + "\n")
