# SPDX-License-Identifier: GPL-3.0-or-later
"""A moment of what python -m tests.device.fuzz does for long."""

from __future__ import annotations

from tests.device.fuzz import TARGETS, run


def test_no_parser_stumbles_over_random_and_spoilt_inputs() -> None:
    assert set(run(1500, seed=7)) == {target.name for target in TARGETS}
