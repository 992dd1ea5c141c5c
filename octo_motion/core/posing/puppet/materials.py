# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials: coefficients of the elements, from words that an artist understands.

The source leaves open how to choose K_f, D_f and D_d ([Plastic, §6]). Here a material says what can
be seen and felt: how much a joint bears before it yields, how far it springs back, how fast it
settles, how fast it gives way. The joint's *load* makes torques of that: the torque with which all
that hangs on it, stretched out level, would bend it under its own weight. So a finger and a thigh
of one material feel alike, and a figure of any size or weight behaves the same.

A material may also be measured: an artist says how one joint is to bend under a pull (``Bend``), or
acts it out with the limb in the hand, and its coefficients follow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from ...errors import SettingsError
from ...phrases import phrase
from ...rotations import Floats
from .figure import Elements, Figure

_FEW: Final = 12
_LEAST: Final = float(np.radians(0.1))
"""Radians below which a bend is none."""
_STIFFEST: Final = float(np.radians(0.5))
"""Radians by which everything springs back, as clay does."""
_CLEAR: Final = float(np.radians(1.0))
"""Radians that a hand means when it moves a limb."""
_REST: Final = 0.1
"""Seconds that a hand holds still where it means to stay."""
_SETTLES: Final = 0.03
"""Seconds, where nothing was shown."""


GRAVITY: Final = 9.81
"""m/s², for the loads; whether the simulation has gravity is another matter."""

_LEAST_LOAD: Final = 1e-3
"""Of the largest load in the figure: what a joint with next to nothing on it counts for."""


@dataclass(frozen=True)
class Material:
    """What a joint is made of, whatever its size."""

    bears: float
    """Yield torque against the joint's load; inf never yields."""
    springs: float
    """Radians that a joint is bent by its load, or by its yield torque if that is finite: so far
    it springs back. inf has no spring."""
    settles: float
    """Seconds, D_f/K_f: how long springing back takes. Without a spring, D_f against the load."""
    gives: float
    """rad/s at twice the yield torque: τ/D_d. Without yield, 0 for a rigid series damper."""
    of_limb: bool = False
    """Whether a whole limb springs back so far, its joints together (``limb_shares``), and not each
    joint by itself."""


@dataclass(frozen=True)
class JointCoefficients:
    """What a joint is made of in numbers, about its bone's X, Y (twist) and Z."""

    stiffness: tuple[float, float, float]
    """K_f, N·m/rad."""
    damping: tuple[float, float, float]
    """D_f, N·m·s/rad."""
    flow: tuple[float, float, float]
    """D_d, N·m·s/rad, above zero."""
    yield_torque: float
    """τ, N·m, below which the joint holds; 0 creeps always, inf never gives way."""


MATERIALS: Final[Mapping[str, Material]] = MappingProxyType(
    {
        # Gives way slowly and stays: of a whole limb, a tenth of a degree comes back.
        "clay": Material(1.25, springs=np.radians(0.1), settles=0.005, gives=1.0, of_limb=True),
        # Bends at once and springs back some.
        "wire": Material(1.25, springs=np.radians(2.0), settles=0.01, gives=10.0, of_limb=True),
        # Dry friction in a socket: firm, and hardly any spring.
        "doll": Material(2.0, springs=np.radians(0.25), settles=0.01, gives=20.0, of_limb=True),
        # Bends by its own weight and always comes back.
        "rubber": Material(bears=np.inf, springs=np.radians(20.0), settles=0.15, gives=0.0),
        # Bears nothing; a little resistance, so that it does not swing for ever.
        "limp": Material(bears=np.inf, springs=np.inf, settles=0.15, gives=0.0),
    }
)


def elements_for(
    figure: Figure,
    material: str | Material,
    strength: float = 1.0,
    own: Mapping[int, Material | JointCoefficients] | None = None,
) -> Elements:
    """The elements of a figure of a material, in ``MATERIALS`` or measured; single bodies may have
    their own, or coefficients, which no strength changes.

    The strength is a factor on all torques: with 1 every joint of a material that yields just bears
    what hangs on it.

    Raises:
        SettingsError: no such material, or a strength that is not positive.
    """
    if isinstance(material, str):
        if material not in MATERIALS:
            raise SettingsError(
                phrase("There is no material '{material}'.", material=material),
                phrase("Choose one of {names}.", names=", ".join(MATERIALS)),
            )
        material = MATERIALS[material]
    if not (np.isfinite(strength) and strength > 0.0):
        raise SettingsError(
            "The strength of the joints is not positive.", "Set it to 1, for example."
        )
    load = strength * joint_loads(figure)
    made_of = [(own or {}).get(body, material) for body in range(len(figure))]
    typed = any(isinstance(each, JointCoefficients) for each in made_of)
    values = np.empty((4, len(figure), 3))
    known = zip(made_of, load.tolist(), limb_shares(figure).tolist(), strict=True)
    for body, (each, at, share) in enumerate(known):
        if isinstance(each, JointCoefficients):
            values[:, body] = each.stiffness, each.damping, each.flow, (each.yield_torque,) * 3
        else:
            values[:, body] = np.array(_values(each, at, share))[:, None]
    if not typed:
        return Elements(*values[:, :, 0])
    return Elements(values[0], values[1], values[2], values[3, :, 0])


def _values(material: Material, load: float, share: float) -> tuple[float, float, float, float]:
    """K_f, D_f, D_d and τ of a joint with a load, N·m, that is a share of its limb."""
    limit = material.bears * load
    bearing = limit if np.isfinite(limit) else load
    stiffness, damping = 0.0, load * material.settles
    if np.isfinite(material.springs):
        stiffness = bearing / (material.springs * (share if material.of_limb else 1.0))
        damping = stiffness * material.settles
    # A joint that never yields has a series damper that never moves; any size will do.
    flow = bearing / material.gives if material.gives > 0.0 else 1e6 * load
    return stiffness, damping, flow, limit


def material_of(measured: MeasuredBend, load: float) -> Material:
    """The material of which a joint with a load, N·m, strength included, has been measured."""
    yields = bool(np.isfinite(measured.yield_torque))
    bearing = measured.yield_torque if yields else load
    return Material(
        bears=measured.yield_torque / load,
        springs=bearing / measured.stiffness,
        settles=measured.damping / measured.stiffness,
        gives=bearing / measured.flow if yields else 0.0,
    )


def limb_shares(figure: Figure) -> Floats:
    """(bodies,) what each bone is of the longest way over it from a root to a tip.

    From any root to any tip they add up to 1 at most: what is divided among joints by them is the
    same for a limb however many bones it has.
    """
    above, below = figure.lengths.copy(), figure.lengths.copy()
    for body, parent in enumerate(figure.parents):
        if parent >= 0:
            above[body] += above[parent]
    for body in range(len(figure) - 1, -1, -1):
        parent = figure.parents[body]
        if parent >= 0:
            below[parent] = max(below[parent], figure.lengths[parent] + below[body])
    return figure.lengths / (above + below - figure.lengths)


def joint_loads(figure: Figure) -> Floats:
    """(bodies,) N·m about each joint, of all that hangs on it, stretched out level."""
    count = len(figure)
    masses = figure.masses.copy()
    moments = figure.masses * np.linalg.norm(figure.centres, axis=1)
    for body in range(count - 1, -1, -1):
        parent = figure.parents[body]
        if parent >= 0:
            arm = float(np.linalg.norm(figure.anchors[body]))
            masses[parent] += masses[body]
            moments[parent] += moments[body] + masses[body] * arm
    loads = GRAVITY * moments
    return np.maximum(loads, _LEAST_LOAD * loads.max(initial=0.0))


# --- Measured from one bend -----------------------------------------------------------------------


@dataclass(frozen=True)
class MeasuredBend:
    """Coefficients of one joint about one axis."""

    stiffness: float
    """K_f, N·m/rad."""
    damping: float
    """D_f, N·m·s/rad."""
    flow: float
    """D_d, N·m·s/rad; inf for a joint that never yields."""
    yield_torque: float
    """N·m; inf likewise."""


@dataclass(frozen=True)
class Bend:
    """What a joint is to do when it is pulled once."""

    torque: float
    """N·m of the pull."""
    bears: float
    """N·m that the joint bears without giving way."""
    seconds: float
    """How long it is pulled."""
    bends: float
    """Radians at the end of the pull."""
    stays: float
    """Radians that are left once it has come to rest; 0 for a joint that never gives way."""
    settles: float
    """Seconds that springing back takes, D_f/K_f."""


def measure_bend(bend: Bend) -> MeasuredBend:
    """The element that does what a bend says.

    With a steady torque T above what the joint is to bear, τ, for t seconds, eq. 20–23 give

        stays = (T − τ) t / D_d,      bends − stays = T (1 − exp(−K_f t / D_f)) / K_f

    so that each coefficient follows from one of the words.

    Raises:
        SettingsError: nothing is bent, more stays than was bent, or the pull is too weak for
            anything to stay.
    """
    if not bend.bends > _LEAST:
        raise SettingsError("The joint is not bent.", "Bend it by a few degrees at least.")
    if bend.stays > bend.bends + 1e-9:
        raise SettingsError(
            "More of the bend stays than there was.", "Let at most as much stay as it was bent by."
        )
    yields = bend.stays > 0.0
    if yields and bend.torque <= bend.bears:
        raise SettingsError(
            "The pull is no stronger than what the joint bears, so that nothing would stay.",
            "Pull harder, or let it bear less.",
        )
    # Without any spring at all, steps would have to be as short as it is stiff.
    spring = max(bend.bends - bend.stays, _STIFFEST)
    reached = -np.expm1(-bend.seconds / bend.settles)
    stiffness = bend.torque * float(reached) / spring
    return MeasuredBend(
        stiffness,
        stiffness * bend.settles,
        (bend.torque - bend.bears) * bend.seconds / bend.stays if yields else np.inf,
        bend.bears if yields else np.inf,
    )


def measure_shown(
    times: Floats, angles: Floats, released: float, torque: float, bears: float
) -> Bend:
    """What was acted out with a limb: it is bent, let go, and led to where it is to stay.

    At times (samples,), s, in which it was held, ascending, it was turned by angles (samples,),
    radians; it was let go for the first time at ``released``. The pull stands for a torque, N·m, of
    which the joint is to bear some.

    Raises:
        SettingsError: nothing was bent, or it had not come to rest yet.
    """
    t, angle = np.asarray(times, dtype=np.float64), np.asarray(angles, dtype=np.float64)
    pulling = t <= released
    bends = float(angle[pulling][-1]) if pulling.any() else 0.0
    if not bends > _CLEAR:
        raise SettingsError(
            "The drag has bent nothing.",
            "Drag the limb about its joint, by a few degrees at least.",
        )
    late = angle[t >= t[-1] - _REST]
    if not pulling.all() and np.ptp(late) > max(_CLEAR, 0.1 * bends):
        raise SettingsError(
            "The limb was still moving when it was let go.",
            "Hold it still for a moment before you let go.",
        )
    begun = int(np.argmax(angle > 0.02 * bends))
    seconds = max(released - float(t[max(begun - 1, 0)]), 0.05)
    stays = float(np.clip(angle[-1], 0.0, bends))
    if stays < max(_CLEAR, 0.02 * bends):
        stays = 0.0
    settles = _SETTLES
    if bends - stays > max(_CLEAR, 0.02 * bends) and (~pulling).sum() >= _FEW:
        # As if the spring were alone: how fast it goes back to where it stays.
        back = t[~pulling] - released
        left = np.clip((angle[~pulling] - stays) / (bends - stays), 0.0, 1.0)
        area = 0.5 * float(((left[1:] + left[:-1]) * np.diff(back)).sum())
        settles = float(np.clip(area, 0.005, 5.0))
    return Bend(torque, bears, seconds, bends, stays, settles)
