# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist asks of a joint, and what a joint with the measured coefficients then does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from octo_motion.core.errors import SettingsError
from octo_motion.core.posing.puppet.joint_limits import bends
from octo_motion.core.posing.puppet.materials import (
    MATERIALS,
    Bend,
    Material,
    elements_for,
    joint_loads,
    material_of,
    measure_bend,
    measure_shown,
)
from octo_motion.core.posing.solver.world import World, WorldSettings
from octo_motion.core.rotations import Floats
from tests.core.puppets import chain, octopus, posed
from tests.core.world_probes import joint_turns

ASKED = Bend(2.0, 1.25, 0.5, np.radians(30.0), np.radians(20.0), 0.05)
"""Torques in loads of the joint."""


def pulled(material: Material, bend: Bend, strength: float = 1.0) -> tuple[float, float]:
    """Degrees of the last joint of a chain at the end of a steady pull, and once it rests."""
    figure = chain(3)
    figure = replace(figure, elements=elements_for(figure, material, strength))
    world = World(figure, posed(figure), WorldSettings())
    world.pin(1, firm=True)
    world.forces[2, 3] = bend.torque * strength * joint_loads(figure)[2]
    for _ in range(round(bend.seconds / 1e-3)):
        world.step()
    most = bends(joint_turns(world)[2])[0]
    world.forces[2] = 0.0
    for _ in range(round((20.0 * bend.settles + 0.5) / 1e-3)):
        world.step()
    return tuple(np.degrees([most, bends(joint_turns(world)[2])[0]]))


def made_of(bend: Bend, load: float = 1.0) -> Material:
    own = replace(bend, torque=bend.torque * load, bears=bend.bears * load)
    return material_of(measure_bend(own), load)


@pytest.mark.parametrize(
    "bend",
    [
        ASKED,
        replace(ASKED, stays=np.radians(30.0)),
        replace(ASKED, stays=0.0),
        replace(ASKED, bends=np.radians(80.0), stays=np.radians(15.0), seconds=0.3, torque=4.0),
        replace(ASKED, settles=0.4, seconds=0.6),
    ],
)
def test_a_simulated_pull_bends_the_joint_as_asked_and_leaves_what_was_asked(bend: Bend):
    most, left = pulled(made_of(bend, 3.7), bend, strength=2.0)
    # The limb has inertia of its own, which the words say nothing about.
    assert most == pytest.approx(np.degrees(bend.bends), rel=0.05)
    assert left == pytest.approx(np.degrees(bend.stays), rel=0.07, abs=0.3)


def test_what_the_joint_bears_does_not_bend_it_for_good():
    weak = replace(ASKED, torque=1.0)
    most, left = pulled(made_of(ASKED), weak)
    assert most > 3.0
    assert left == pytest.approx(0.0, abs=0.05)


def test_a_measured_material_has_the_coefficients_that_were_measured():
    figure = octopus()
    loads = joint_loads(figure)
    measured = measure_bend(replace(ASKED, torque=2.0 * loads[5], bears=1.25 * loads[5]))
    found = elements_for(figure, material_of(measured, float(loads[5])))
    assert found.stiffness[5] == pytest.approx(measured.stiffness)
    assert found.damping[5] == pytest.approx(measured.damping)
    assert found.flow[5] == pytest.approx(measured.flow)
    assert found.yield_torque[5] == pytest.approx(measured.yield_torque)


def test_single_joints_may_be_of_another_material():
    figure = chain(3)
    whole = elements_for(figure, "clay")
    mixed = elements_for(figure, "clay", own={1: MATERIALS["rubber"]})
    rubber = elements_for(figure, "rubber")
    assert np.isinf(mixed.yield_torque[1])
    np.testing.assert_allclose(mixed.stiffness[1], rubber.stiffness[1])
    for body in (0, 2):
        np.testing.assert_allclose(mixed.stiffness[body], whole.stiffness[body])
        assert mixed.yield_torque[body] == whole.yield_torque[body]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (replace(ASKED, bends=0.0, stays=0.0), "is not bent"),
        (replace(ASKED, stays=1.0), "More of the bend stays"),
        (replace(ASKED, torque=1.0), "no stronger than what the joint bears"),
    ],
)
def test_a_bend_that_makes_no_sense_is_told(wrong: Bend, said: str):
    with pytest.raises(SettingsError, match=said):
        measure_bend(wrong)


# --- Acted out -----------------------------------------------------------------------------------


def acted(*, pause: float = 0.2, back: float = 0.1) -> tuple[Floats, Floats, float]:
    """A hand waits, bends a joint by 30° in half a second, lets go, and leads it back to 20°."""
    times = np.arange(1, 91) / 60.0
    released = 0.2 + 0.5
    rising = np.clip((times - 0.2) / 0.5, 0.0, 1.0) * np.radians(30.0)
    falling = np.radians(10.0) * (1.0 - np.exp(-np.maximum(times - released - pause, 0.0) / back))
    return times, rising - falling, released


def test_what_was_acted_out_is_read_off_the_drag():
    bend = measure_shown(*acted(pause=0.0), 2.0, 1.25)
    assert np.degrees(bend.bends) == pytest.approx(30.0, abs=0.1)
    assert np.degrees(bend.stays) == pytest.approx(20.0, abs=0.2)
    assert bend.seconds == pytest.approx(0.5, abs=0.03)
    assert bend.settles == pytest.approx(0.1, abs=0.02)
    most, left = pulled(made_of(bend), bend)
    assert most == pytest.approx(30.0, rel=0.05)
    assert left == pytest.approx(20.0, rel=0.05)


def test_a_limb_that_is_left_where_it_was_bent_stays_there_whole():
    times, angles, released = acted()
    held = times <= released
    bend = measure_shown(times[held], angles[held], released, 2.0, 1.25)
    assert bend.stays == bend.bends


def test_a_limb_that_is_led_all_the_way_back_never_gives_way():
    times, angles, released = acted(pause=0.0)
    bend = measure_shown(times, np.where(times > released, 0.0, angles), released, 2.0, 1.25)
    assert bend.stays == 0.0
    assert np.isinf(measure_bend(bend).yield_torque)


def test_a_drag_that_shows_nothing_is_told():
    times, angles, released = acted()
    with pytest.raises(SettingsError, match="has bent nothing"):
        measure_shown(times, 0.001 * angles, released, 2.0, 1.25)
    moving = times < released + 0.3
    with pytest.raises(SettingsError, match="still moving"):
        measure_shown(times[moving], angles[moving], released, 2.0, 1.25)
