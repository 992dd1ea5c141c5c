# SPDX-License-Identifier: GPL-3.0-or-later
"""The curve of the joint weights, which Blender keeps in a node."""

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.files.weight_curve import (
    curve_node,
    ensure_weight_curve,
    sample_weight_curve,
)
from octo_motion.core.errors import SettingsError


def test_a_new_curve_is_the_line_between_the_two_weights() -> None:
    group = ensure_weight_curve(None, 0.8, 0.2)
    np.testing.assert_allclose(sample_weight_curve(group, 5), np.linspace(0.8, 0.2, 5), atol=1e-5)


def test_what_the_artist_has_drawn_is_sampled() -> None:
    group = ensure_weight_curve(None, 0.5, 0.5)
    node: Any = curve_node(group)
    node.mapping.curves[0].points.new(0.5, 1.0)
    node.mapping.update()
    values = sample_weight_curve(group, 3)
    np.testing.assert_allclose(values, (0.5, 1.0, 0.5), atol=1e-3)


def test_a_curve_that_is_there_is_kept() -> None:
    group = ensure_weight_curve(None, 0.5, 0.5)
    assert ensure_weight_curve(group, 0.1, 0.1) == group
    np.testing.assert_allclose(sample_weight_curve(group, 2), (0.5, 0.5), atol=1e-6)


def test_a_node_group_without_the_curve_is_replaced() -> None:
    other: Any = bpy.data.node_groups.new("Other", "ShaderNodeTree")
    assert ensure_weight_curve(other, 0.5, 0.5) != other


def test_a_missing_curve_is_told() -> None:
    with pytest.raises(SettingsError, match="is gone"):
        sample_weight_curve(None, 3)
