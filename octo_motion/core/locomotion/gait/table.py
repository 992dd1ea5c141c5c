# SPDX-License-Identifier: GPL-3.0-or-later
"""Gait tables as data: three angles for each of three links over one cycle [Octopus, §3.3].

The angles have the source's names. **Head** (ヘッド角) turns a link up and down about its lateral
axis, positive raises. **Pitch** (ピッチ角) turns it left and right about its vertical axis,
positive towards the front of the body, mirrored on the left and the right. **Bank** (バンク角)
twists the arm about the link; it moves no target.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from ...errors import GaitError
from ...phrases import phrase
from ...rotations import Floats

ANGLES: Final = ("head", "pitch", "bank")
LINKS: Final = 3
SIDES: Final = ("LEFT", "CENTER", "RIGHT")
CYCLE: Final = 2.0 * np.pi
FORMAT: Final = "octo_motion.gait"
FORMAT_VERSION: Final = 1

Manner = Literal["WALK", "CRAWL", "SWIM"]
MANNERS: Final[tuple[Manner, ...]] = ("WALK", "CRAWL", "SWIM")


@dataclass(frozen=True)
class GaitCurve:
    """The angles of one arm over one cycle, linear between knots."""

    phases: Floats
    """(knots,) radians, ascending from 0 to 2π."""
    angles: Floats
    """(knots, links, angles) radians, in the order of ``ANGLES``; the last equals the first."""
    free: bool = False
    """Whether the arm never holds on to the ground, and all its cycle is a swing."""

    def evaluate(self, phase: Floats) -> Floats:
        """Angles (…, links, angles) at phases (…) in radians, of any cycle.

        The pieces of [Octopus, eq. 3.8–3.10] for a walk, eq. 3.15–3.17 for a swim.
        """
        knot, share = self.locate(phase)
        share = share[..., None, None]
        return (1.0 - share) * self.angles[knot] + share * self.angles[knot + 1]

    def locate(self, phase: Floats) -> tuple[np.ndarray, Floats]:
        """The knot before each phase, and the share of the way to the next."""
        inside = np.mod(phase, CYCLE)
        knot = np.clip(np.searchsorted(self.phases, inside, "right") - 1, 0, len(self.phases) - 2)
        start, end = self.phases[knot], self.phases[knot + 1]
        return knot, (inside - start) / (end - start)

    def rounding(self, phase: Floats, smoothing_cycles: float) -> Floats:
        """What rounds corners off at phases (…), radians: evens out what is linear between knots
        over time.

        The mean of a straight line over a window is the line itself. So the weighted mean over so
        many cycles before and after, half at most, with weights that fall off evenly to nothing,
        differs from what has corners by one such part for each corner: h (1 − |t| / h)³ / 6 of its
        change of slope, at a time t away within a window of h.

        (…, knots − 1) radians, for the change of slope at each knot but the last, which is the
        first again.
        """
        within = smoothing_cycles * CYCLE
        away = phase[..., None] - self.phases[:-1]
        away -= CYCLE * np.rint(away / CYCLE)
        return within / 6.0 * np.maximum(1.0 - np.abs(away) / within, 0.0) ** 3


@dataclass(frozen=True)
class GaitTable:
    """A gait: one curve for all arms, others for single pairs, and how phases are spread."""

    name: str
    manner: Manner
    """Whether the body walks (upright, all arms in step), crawls (upright, each arm in its own
    time) or swims (mantle ahead)."""
    curves: dict[int, GaitCurve]
    """By arm pair, 1 in front, −1 the last one, counted from the rear; 0 serves every pair that has
    none of its own."""
    spread_pairs: float = 0.0
    """Cycles by which a pair after the last would be ahead of the first."""
    spread_sides: float = 0.0
    """Cycles by which the right side is ahead of the left."""
    spread_halves: float = 0.0
    """Cycles by which the rear half of the pairs is ahead of the front half."""
    offsets: dict[tuple[int, str], float] = field(default_factory=dict)
    """Radians by which single arms, by pair, as of ``curves``, and side, are ahead; they replace
    the spread."""
    stride: float = 1.0
    """Distance travelled in one cycle, in arm lengths: what the gait looks right with."""
    power_phase: float = 0.0
    """Phase at the middle of the power stroke, radians."""
    description: str = ""
    notes: dict[str, str] = field(default_factory=dict)

    @property
    def on_ground(self) -> bool:
        """Whether the body goes over the ground, upright."""
        return self.manner != "SWIM"

    def curve(self, pair: int) -> GaitCurve:
        """The curve for one pair of arms."""
        return self.curves.get(pair, self.curves[0])

    def for_pairs(self, pairs: int) -> GaitTable:
        """The table for a body of so many pairs of arms, all of them counted from the front.

        Where a gait lets some arms hold no ground, those of its last pair are the ones that do,
        and so are the rear arms of a body that has fewer: else nothing would carry it.
        """
        curves, offsets = self.curves, self.offsets
        front = {pair: curve for pair, curve in curves.items() if pair >= 0}
        known = [*front, *(pair for pair, _ in offsets if pair > 0)]
        beyond = max(known) - pairs if any(curve.free for curve in front.values()) else 0
        if beyond > 0:
            curves = {
                pair - beyond if pair > 0 else pair: curve
                for pair, curve in curves.items()
                if pair <= 0 or pair > beyond
            }
            offsets = {
                (pair - beyond if pair > 0 else pair, side): offset
                for (pair, side), offset in offsets.items()
                if pair < 0 or pair > beyond
            }
        elif not any(pair < 0 for pair in (*curves, *(pair for pair, _ in offsets))):
            return self

        def placed(pair: int) -> int:
            return pair if pair >= 0 else pairs + 1 + pair

        # Those counted from the front come later, and count where a pair is told both ways.
        return replace(
            self,
            curves={
                placed(pair): curve
                for pair, curve in sorted(curves.items())
                if pair == 0 or placed(pair) > 0
            },
            offsets={
                (placed(pair), side): offset
                for (pair, side), offset in sorted(offsets.items())
                if placed(pair) > 0
            },
        )

    def offset(self, side: str, pair: int, pairs: int) -> float:
        """Radians that an arm is ahead of the body's phase, for a body of so many pairs.

        The source leaves the offsets open. Ours are a wave that runs over the pairs from back to
        front while the sides alternate: with the preset of one cycle over the pairs and half a
        cycle between the sides, eight arms fill the cycle two by two, each with its diagonal.
        """
        if (pair, side) in self.offsets:
            return self.offsets[pair, side]
        side_share = {"LEFT": 0.0, "CENTER": 0.5, "RIGHT": 1.0}[side]
        cycles = self.spread_pairs * (pair - 1) / max(pairs, 1) + self.spread_sides * side_share
        if self.spread_halves != 0.0:
            # A pair in the middle is half way, as an arm in the middle is.
            cycles += self.spread_halves * 0.5 * (1.0 + np.sign(2 * pair - pairs - 1))
        return float(CYCLE * cycles)


def gait_angles(
    table: GaitTable, phases: Floats, pairs: tuple[int, ...], *, smoothing_cycles: float = 0.0
) -> Floats:
    """Angles (frames, arms, links, angles), radians, of arms of these pairs at phases (frames,
    arms), radians, each arm's own offset included.

    They are evened out over cycles before and after each moment (:meth:`GaitCurve.rounding`).
    """
    result = np.empty((*phases.shape, LINKS, len(ANGLES)))
    for pair, columns in columns_by_curve(table, pairs).items():
        curve, own = table.curve(pair), phases[:, columns]
        result[:, columns] = curve.evaluate(own)
        if smoothing_cycles > 0.0:
            slopes = np.diff(curve.angles, axis=0) / np.diff(curve.phases)[:, None, None]
            corners = slopes - np.roll(slopes, 1, axis=0)
            rounding = curve.rounding(own, smoothing_cycles)
            result[:, columns] += np.einsum("fak,klc->falc", rounding, corners)
    return result


def columns_by_curve(table: GaitTable, pairs: tuple[int, ...]) -> dict[int, np.ndarray]:
    """Arms grouped by the curve that they use."""
    keys = np.array([pair if pair in table.curves else 0 for pair in pairs])
    return {key: np.flatnonzero(keys == key) for key in sorted(set(keys.tolist()))}


def curve_from_degrees(phases: list[float], **angles: list[list[float]]) -> GaitCurve:
    """A curve from degrees, each angle as one list of knot values for each link, zero if not given.

    Raises:
        ValueError: phases are no row of numbers, or an angle has not one for each link and knot.
    """
    knots = np.asarray(phases, dtype=np.float64)
    if knots.ndim != 1:
        raise ValueError("its phases are no row of numbers")
    table = np.zeros((len(knots), LINKS, len(ANGLES)))
    for name, links in angles.items():
        values = np.asarray(links, dtype=np.float64)
        # One number would do for all links and knots, a row for one of the two: nobody means it.
        if values.shape != (LINKS, len(knots)):
            raise ValueError(f"{name} has not one number for each link and phase")
        table[:, :, ANGLES.index(name)] = values.T
    return GaitCurve(np.radians(knots), np.radians(table))


def check_gait(table: GaitTable) -> GaitTable:
    """The table, if it can be used.

    Raises:
        GaitError: numbers that are not finite, knots that do not ascend from 0 to 2π, a last
            value that differs from the first, a table that serves not every pair.
    """
    where = phrase("Gait '{table}'", table=table.name)
    if 0 not in table.curves:
        raise GaitError(
            phrase("{where} has no curve for all arms.", where=where), "Give it a curve for pair 0."
        )
    scalars = (
        *(table.spread_pairs, table.spread_sides, table.spread_halves),
        *(table.stride, table.power_phase),
        *table.offsets.values(),
    )
    if not np.isfinite(scalars).all():
        raise GaitError(
            phrase("{where} has a number that is not finite.", where=where), "Correct it."
        )
    if table.stride <= 0.0:
        raise GaitError(
            phrase("{where} has a stride of {stride:g}.", where=where, stride=table.stride),
            "It must be above zero.",
        )
    for pair, curve in table.curves.items():
        place = phrase("{where}, pair {pair}", where=where, pair=pair) if pair else where
        if not (np.isfinite(curve.phases).all() and np.isfinite(curve.angles).all()):
            raise GaitError(
                phrase("{place} has a number that is not finite.", place=place), "Correct it."
            )
        if curve.angles.shape != (len(curve.phases), LINKS, len(ANGLES)):
            raise GaitError(
                phrase(
                    "{place} does not have three angles of three links at every knot.", place=place
                ),
                "Complete it.",
            )
        if len(curve.phases) < 2 or abs(curve.phases[0]) > 1e-9:
            raise GaitError(
                phrase("{place} does not start at phase 0.", place=place), "Add a knot there."
            )
        if abs(curve.phases[-1] - CYCLE) > 1e-9:
            raise GaitError(
                phrase("{place} does not end at phase 360°.", place=place), "Add a knot there."
            )
        if np.any(np.diff(curve.phases) <= 0.0):
            raise GaitError(
                phrase("{place} has knots that do not ascend.", place=place), "Sort them by phase."
            )
        if np.max(np.abs(curve.angles[0] - curve.angles[-1])) > 1e-9:
            raise GaitError(
                phrase("{place} ends at other angles than it starts with.", place=place),
                "Make the values at 0° and 360° equal.",
            )
    return table


def gait_to_json(table: GaitTable) -> str:
    """The table as a text that people can edit: degrees, one list for each angle and link."""
    curves = {}
    for pair, curve in sorted(table.curves.items()):
        degrees = np.degrees(curve.angles)
        curves["all" if pair == 0 else str(pair)] = {
            "phase": _rounded(np.degrees(curve.phases)),
            **{
                name: [_rounded(degrees[:, link, number]) for link in range(LINKS)]
                for number, name in enumerate(ANGLES)
                if np.any(degrees[:, :, number])
            },
            **({"free": True} if curve.free else {}),
        }
    content = {
        "format": FORMAT,
        "version": FORMAT_VERSION,
        "name": table.name,
        "description": table.description,
        "manner": table.manner.lower(),
        "spread": {
            "pairs": table.spread_pairs,
            "sides": table.spread_sides,
            **({"halves": table.spread_halves} if table.spread_halves else {}),
        },
        "offsets": {
            f"{pair} {side.lower()}": _rounded(np.degrees([offset]))[0]
            for (pair, side), offset in sorted(table.offsets.items())
        },
        "stride": table.stride,
        "power_phase": _rounded(np.degrees([table.power_phase]))[0],
        "pairs": curves,
        "notes": table.notes,
    }
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def _rounded(values: Any) -> list[float]:
    # Twelve digits: exact to 1e-14 rad, without the noise of the conversion to degrees.
    return [float(f"{value:.12g}") for value in values]


def gait_from_json(text: str, source: str = phrase("The gait file")) -> GaitTable:
    """The table in a text made by ``gait_to_json`` or by hand.

    The source is what error messages call it, such as the file's name.

    Raises:
        GaitError: no JSON, not a gait, from a newer version, or damaged (see ``check_gait``).
    """
    content = _content(text, source)
    try:
        manner = str(content["manner"]).upper()
        known: dict[str, Manner] = {each: each for each in MANNERS}
        curves = {
            0 if key == "all" else int(key): replace(
                curve_from_degrees(
                    each["phase"], **{name: each[name] for name in ANGLES if name in each}
                ),
                free=bool(each.get("free", False)),
            )
            for key, each in content["pairs"].items()
        }
        spread = content.get("spread", {})
        table = GaitTable(
            name=str(content["name"]),
            manner=known.get(manner, "WALK"),
            curves=curves,
            spread_pairs=float(spread.get("pairs", 0.0)),
            spread_sides=float(spread.get("sides", 0.0)),
            spread_halves=float(spread.get("halves", 0.0)),
            offsets={
                _arm_of(key): float(np.radians(float(value)))
                for key, value in content.get("offsets", {}).items()
            },
            stride=float(content.get("stride", 1.0)),
            power_phase=float(np.radians(float(content.get("power_phase", 0.0)))),
            description=str(content.get("description", "")),
            notes={str(key): str(value) for key, value in content.get("notes", {}).items()},
        )
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise GaitError(
            phrase(
                "{source} is damaged ({name}: {error}).",
                source=source,
                name=type(error).__name__,
                error=error,
            ),
            "Save the gait anew.",
        ) from error
    if manner not in MANNERS:
        raise GaitError(
            phrase("{source} has the manner {manner!r}.", source=source, manner=manner),
            "It must be walk, crawl or swim.",
        )
    return check_gait(table)


def _content(text: str, source: str) -> dict[str, Any]:
    """What a gait file of this version says, not yet looked into; arguments as above."""
    try:
        content = json.loads(text)
    except json.JSONDecodeError as error:
        raise GaitError(
            phrase(
                "{source} is not JSON (line {lineno}: {msg}).",
                source=source,
                lineno=error.lineno,
                msg=error.msg,
            ),
            "Choose a gait file.",
        ) from error
    except (ValueError, RecursionError) as error:
        # A number of thousands of digits, or brackets in brackets without end.
        raise GaitError(
            phrase("{source} is not JSON ({error}).", source=source, error=error),
            "Choose a gait file.",
        ) from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise GaitError(
            phrase("{source} is not a gait of Octo Motion.", source=source), "Choose a gait file."
        )
    if content.get("version") != FORMAT_VERSION:
        raise GaitError(
            phrase(
                "{source} has format version {version!r}, not {known}.",
                source=source,
                version=content.get("version"),
                known=FORMAT_VERSION,
            ),
            "Update Octo Motion, or save the gait anew.",
        )
    return content


def _arm_of(key: str) -> tuple[int, str]:
    """Pair and side from a text such as "1 left", or "-1 left" of the last pair."""
    pair, side = key.upper().split()
    if side not in SIDES:
        raise ValueError(f"no side is called {side!r}")
    return int(pair), side


def gait_presets() -> dict[str, GaitTable]:
    """The gaits that come with the extension, by name."""
    return dict(_shipped())


@cache
def _shipped() -> dict[str, GaitTable]:
    tables = (
        gait_from_json(path.read_text(encoding="utf-8"), path.name)
        for path in sorted((Path(__file__).parent / "presets").glob("*.json"))
    )
    return {table.name: table for table in tables}


def renamed_gait(table: GaitTable, name: str) -> GaitTable:
    """The same table under another name."""
    return replace(table, name=name)
