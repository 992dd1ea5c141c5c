# SPDX-License-Identifier: GPL-3.0-or-later
"""What was learned of devices is there again next time, and nothing damaged does harm."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator
from typing import Any

import pytest

from octo_motion.blender.files import user_files as device_store
from octo_motion.blender.files.user_files import load_calibrations, save_calibrations
from octo_motion.core.errors import WriteError
from octo_motion.device.calibration import Calibration

WORN = Calibration(rest=(0.1, 0.0, -0.05, 0.0, 0.0, 0.02))


@pytest.fixture(autouse=True)
def no_devices_of_the_user() -> Iterator[None]:
    yield
    device_store._path().unlink(missing_ok=True)


def test_what_was_learned_is_there_again() -> None:
    assert load_calibrations() == {}
    save_calibrations({"256f:c635:": WORN, "haply": Calibration()})
    assert load_calibrations() == {"256f:c635:": WORN, "haply": Calibration()}
    save_calibrations({})
    assert load_calibrations() == {}


@pytest.mark.parametrize("text", ["", "{", "[]", "7", '{"format": "other", "devices": {"a": 1}}'])
def test_damaged_file_counts_as_none(text: str, caplog: pytest.LogCaptureFixture) -> None:
    save_calibrations({"haply": WORN})
    device_store._path().write_text(text, encoding="utf-8")
    with caplog.at_level(logging.WARNING):
        assert load_calibrations() == {}


def test_damaged_device_does_not_take_the_others_with_it() -> None:
    save_calibrations({"good": WORN, "short": WORN, "wrong": WORN, "odd": WORN})
    path = device_store._path()
    data: Any = json.loads(path.read_text(encoding="utf-8"))
    data["devices"]["short"]["rest"] = [0.0]
    data["devices"]["wrong"]["rest"] = [5.0] * 6
    data["devices"]["odd"] = "nothing"
    path.write_text(json.dumps(data), encoding="utf-8")
    assert load_calibrations() == {"good": WORN}


def test_folder_that_cannot_be_written_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.open", refuse)
    with pytest.raises(WriteError, match="Permission denied"):
        save_calibrations({"haply": WORN})
