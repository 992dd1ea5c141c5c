# SPDX-License-Identifier: GPL-3.0-or-later
"""What tests of many splices of a few clips share."""

from collections.abc import Iterator

import pytest

from tests.core.splice_bodies import reference_poses_found_once


@pytest.fixture(scope="module")
def reference_poses() -> Iterator[None]:
    """Each clip's reference pose is found once for all tests of a file."""
    with reference_poses_found_once():
        yield
