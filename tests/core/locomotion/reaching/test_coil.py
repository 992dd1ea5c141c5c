# SPDX-License-Identifier: GPL-3.0-or-later
"""An arm's end winds about things of any form, close to them and never through them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.errors import RigError
from octo_motion.core.locomotion.reaching.winding import (
    Coil,
    Profile,
    Skins,
    Winding,
    WindingStart,
    profile_of,
    wind,
)
from octo_motion.core.rotations import Floats, from_axis_angle, normalized, rotate
from tests.core import objects

FORMS = {
    "rod": objects.rod(),
    "thin rod": objects.rod(0.02),
    "bottle": objects.bottle(),
    "ball": objects.ball(),
    "box": objects.box(),
    "board": objects.box((0.05, 0.3, 0.6)),
}
every_form = pytest.mark.parametrize("name", FORMS)
JOINTS = 30
LENGTHS = np.full(JOINTS, 1.0 / JOINTS)
RADII = np.linspace(0.04, 0.008, JOINTS + 1)


def wound(
    profile: Profile, start: Floats, sense: int = 1, turns: float = 3.0, first: int = 12
) -> Coil:
    skins = Skins.of(profile, RADII)
    return wind(skins, LENGTHS, WindingStart(first, start), Winding(turns, sense))


def outside(profile: Profile, away: float = 0.5) -> Floats:
    """A place beside the object, at the middle of its height."""
    middle = 0.5 * (profile.heights[0] + profile.heights[-1])
    return profile.to_object(np.array([away, 0.1, middle]))


@every_form
@pytest.mark.parametrize("sense", [1, -1])
def test_the_skin_lies_on_the_object_and_not_in_it(name: str, sense: int) -> None:
    profile = profile_of(*FORMS[name])
    coil = wound(profile, outside(profile), sense)
    assert coil.angle > np.pi
    count = len(coil.joints)
    along = np.linspace(0.0, 1.0, 9)[:, None, None]
    points = (1.0 - along) * coil.joints[:-1] + along * coil.joints[1:]
    skin = (1.0 - along[..., 0]) * RADII[12 : 11 + count] + along[..., 0] * RADII[13 : 12 + count]
    rest = profile.clearance(points) / skin
    # Bones press in by 0.3 of the skin; profiles are cut into slices and directions.
    assert rest.min() > 0.64
    # Joints touch, but for what it takes for the bones between them to clear the object.
    half = 0.5 * LENGTHS[0]
    joints = profile.clearance(coil.joints)
    assert np.max(joints - RADII[12 : 12 + count]) < half


@every_form
def test_bones_keep_their_lengths(name: str) -> None:
    profile = profile_of(*FORMS[name])
    coil = wound(profile, outside(profile))
    lengths = np.linalg.norm(np.diff(coil.joints, axis=0), axis=1)
    np.testing.assert_allclose(lengths, LENGTHS[12 : 12 + len(lengths)], rtol=1e-9)


@every_form
def test_suckers_face_the_object(name: str) -> None:
    profile = profile_of(*FORMS[name])
    coil = wound(profile, outside(profile))
    middles = 0.5 * (coil.joints[1:] + coil.joints[:-1])
    assert np.all(np.sum(coil.facing * profile.way_out(middles, np.array(1e-9)), axis=1) < -0.99)


def test_turns_lie_beside_each_other() -> None:
    profile = profile_of(*objects.rod(0.03))
    coil = wound(profile, outside(profile), turns=2.5, first=6)
    local = profile.to_profile(coil.joints)
    angle = np.unwrap(np.arctan2(local[:, 1], local[:, 0]))
    assert abs(angle[-1] - angle[0]) > 2.0 * np.pi
    level = np.interp(angle + 2.0 * np.pi, angle, local[:, 2], right=np.nan)
    thick = RADII[6 : 6 + len(local)]
    later = np.interp(angle + 2.0 * np.pi, angle, thick, right=np.nan)
    apart = np.abs(level - local[:, 2])
    known = np.isfinite(apart)
    assert known.sum() > 3
    assert np.all(apart[known] >= 0.95 * (thick + later)[known])


def test_it_winds_no_more_than_asked() -> None:
    profile = profile_of(*objects.rod(0.03))
    for turns in (0.5, 1.0, 1.5):
        coil = wound(profile, outside(profile), turns=turns, first=6)
        one = 2.0 * np.arctan(LENGTHS[0] / 2.0 / 0.03)
        assert 2.0 * np.pi * turns <= coil.angle <= 2.0 * np.pi * turns + one


def test_a_coil_stays_on_an_object_that_is_short() -> None:
    profile = profile_of(*objects.turned_form([(0, 0), (0.1, 0), (0.1, 0.06), (0, 0.06)]), axis=UP)
    coil = wound(profile, np.array([0.5, 0.0, 0.4]))
    height = coil.joints[:, 2]
    assert height.min() > 0.0
    assert height.max() < 0.06


UP = np.array([0.0, 0.0, 1.0])


def test_a_bottle_is_narrow_at_its_neck() -> None:
    profile = profile_of(*objects.bottle(0.08, 0.5))
    beside = np.array([[0.1, 0.0, 0.1], [0.1, 0.0, 0.45]])
    np.testing.assert_allclose(profile.clearance(beside), [0.02, 0.076], atol=1e-3)


@given(st.integers(0, 2**31))
@settings(max_examples=20)
def test_the_axis_goes_along_what_is_long_however_it_lies(seed: int) -> None:
    random = np.random.default_rng(seed)
    turn = from_axis_angle(normalized(random.normal(size=3)), random.uniform(0.0, np.pi))
    vertices, faces = objects.rod(0.05, 1.0)
    profile = profile_of(rotate(turn, vertices) + random.normal(size=3), faces)
    along = rotate(turn, UP)
    # One of the object's own axes is taken if it is within ten degrees.
    assert abs(profile.axes[:, 2] @ along) > np.cos(np.radians(10.5))


@given(st.floats(0.0, 2.0 * np.pi), st.floats(-0.2, 0.2))
@settings(max_examples=40)
def test_clearance_of_a_box_is_the_distance_across_its_faces(angle: float, height: float) -> None:
    profile = profile_of(*objects.box((0.2, 0.2, 0.6)))
    away = 0.5 * np.array([np.cos(angle), np.sin(angle)])
    point = np.array([*away, height])
    exact = np.hypot(*np.maximum(np.abs(away) - 0.1, 0.0))
    # Directions are five degrees apart.
    assert profile.clearance(point) == pytest.approx(exact, rel=2e-3)


@pytest.mark.parametrize("size", [1e-6, 1e3, 1e9])
@pytest.mark.parametrize("taper", [0.0, 0.5])
def test_an_arm_winds_alike_whatever_the_unit_of_length(size: float, taper: float) -> None:
    vertices, faces = objects.rod()
    radii = 0.02 * np.linspace(1.0, 1.0 - taper, JOINTS + 1)

    def angle(size: float) -> float:
        profile = profile_of(size * vertices, faces)
        start = WindingStart(12, outside(profile, 0.5 * size))
        return wind(Skins.of(profile, size * radii), size * LENGTHS, start, Winding(3.0, 1)).angle

    # Joints are lifted until they lack nothing: which of them do is a matter of the last digits.
    assert angle(size) == pytest.approx(angle(1.0), rel=1e-3)


def test_what_cannot_be_wound_about_is_told() -> None:
    vertices, faces = objects.rod()
    with pytest.raises(RigError, match="no faces"):
        profile_of(vertices, faces[:0])
    with pytest.raises(RigError, match="no size"):
        profile_of(0.0 * vertices, faces)
    plate = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    halves = np.array([[0, 1, 2], [0, 2, 3]])
    with pytest.raises(RigError, match="or choose another axis"):
        profile_of(plate, halves)
    assert profile_of(plate, halves, np.array([1.0, 0.0, 0.0])).heights[-1] > 0.9
    profile = profile_of(vertices, faces)
    with pytest.raises(RigError, match="within the object"):
        wound(profile, np.array([0.01, 0.0, 0.5]))
