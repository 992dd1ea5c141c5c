# SPDX-License-Identifier: GPL-3.0-or-later
"""The lines that show a puppet lie where its limbs are."""

import numpy as np
import pytest

from octo_motion.core.posing.wireframe import arrow_lines, capsule_lines, load_colours, pin_lines


def test_every_line_of_a_capsule_lies_on_its_surface() -> None:
    rng = np.random.default_rng(3)
    ends, radii = rng.normal(size=(20, 2, 3)), rng.uniform(0.1, 0.5, 20)
    lines = capsule_lines(ends, radii)
    axis = ends[:, 1] - ends[:, 0]
    points = lines.reshape(20, -1, 3) - ends[:, :1]
    share = (points @ axis[:, :, None])[..., 0] / (axis**2).sum(axis=1)[:, None]
    nearest = np.clip(share, 0.0, 1.0)[..., None] * axis[:, None]
    apart = np.linalg.norm(points - nearest, axis=2)
    assert apart == pytest.approx(np.broadcast_to(radii[:, None], apart.shape))


def test_ball_is_drawn_as_one() -> None:
    ends = np.zeros((1, 2, 3))
    assert np.linalg.norm(capsule_lines(ends, np.ones(1)), axis=-1) == pytest.approx(1.0)


def test_arrow_leads_from_limb_to_hand_from_wherever_it_is_seen() -> None:
    start, end = np.zeros(3), np.array([0.0, 0.0, 2.0])
    for eye in ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]):
        lines = arrow_lines(start, end, np.array(eye))
        assert lines.shape == (3, 2, 3)
        assert lines[0] == pytest.approx(np.stack([start, end]))
        assert np.isfinite(lines).all()
    assert len(arrow_lines(start, start, np.array([1.0, 0.0, 0.0]))) == 0


def test_joint_gets_redder_the_more_it_bears() -> None:
    colours = load_colours(np.array([0.0, 0.5, 1.0, 7.0]))
    redness = colours[:, 0] - colours[:, 2]
    assert (np.diff(redness[:3]) > 0.0).all()
    assert colours[3] == pytest.approx(colours[2])


def test_pin_is_drawn_about_its_joint() -> None:
    lines = pin_lines(np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]]), 0.1)
    assert lines.shape == (24, 2, 3)
    assert lines[:12].reshape(-1, 3).mean(axis=0) == pytest.approx([1.0, 2.0, 3.0])
