# SPDX-License-Identifier: GPL-3.0-or-later
"""What mouse and keys do while a puppet is posed: a plain class that needs no window."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import Enum
from types import MappingProxyType
from typing import Any, Final, Protocol

import numpy as np

from ...core.errors import OctoMotionError
from ...core.phrases import as_phrase, joined_phrases, phrase
from ...core.posing.picking import Hit
from ...core.posing.solver import HandSpring
from ...core.rotations import IDENTITY, Floats, from_axis_angle, multiply
from .measuring_hand import MeasuringHand
from .puppet_session import PuppetSession
from .viewport import go_to

HELP: Final = (
    (phrase("L Drag"), phrase("pull")),
    (phrase("Wheel"), phrase("depth")),
    (phrase("R Drag, Ctrl Wheel"), phrase("turn")),
    (phrase("Shift"), phrase("fine")),
    (phrase("G"), phrase("grab or free")),
    (phrase("P"), phrase("pin")),
    (phrase("K"), phrase("key touched")),
    (phrase("Shift K"), phrase("key all")),
    (phrase("O"), phrase("record")),
    (phrase("M"), phrase("measure")),
    (phrase("R"), phrase("restore")),
    (phrase("Ctrl Z"), phrase("back")),
    (phrase("Ctrl Shift Z"), phrase("forward")),
    (phrase("Enter"), phrase("keep")),
    (phrase("Esc"), phrase("as it was")),
)
MEASURING: Final = (
    (phrase("L Drag"), phrase("bend the limb and let go; then lead it to where it is to stay")),
    (phrase("Wheel"), phrase("pull")),
    (phrase("M, Enter"), phrase("the figure becomes so")),
    (phrase("Shift M"), phrase("this joint alone")),
    (phrase("Esc"), phrase("no")),
)
PULL_STEP: Final = 0.25
"""In what hangs on the joint, per notch of the wheel while measuring."""
FINE: Final = 0.1
"""Of a movement, with Shift."""
DEPTH_STEP: Final = 0.03
"""Of the puppet's size, per notch of the wheel."""
TURN_STEP: Final = float(np.radians(5.0))
"""Per notch of the wheel."""
TURN_PER_PIXEL: Final = float(np.radians(0.5))
MARGIN: Final = 0.012
"""By how much a limb may be missed, as a share of its distance."""

_PASSED: Final = frozenset(
    {
        *("MIDDLEMOUSE", "TRACKPADPAN", "TRACKPADZOOM", "SPACE", "INBETWEEN_MOUSEMOVE"),
        *("NDOF_MOTION", "HOME"),
    }
)
_OWN: Final = frozenset({"G", "P", "K", "O", "R", "Z"})
"""Keys of a session that mean nothing while measuring, and nothing else to Blender either."""
_NONE: Final[Mapping[HandSpring, tuple[Floats, Floats]]] = MappingProxyType({})
_ARROWS: Final = {"LEFT_ARROW": -1, "RIGHT_ARROW": 1}


class EyeOn(Protocol):
    """A viewport."""

    def ray(self, x: float, y: float) -> tuple[Floats, Floats]: ...

    def at_depth(self, x: float, y: float, point: Floats) -> Floats: ...

    def axes(self) -> Floats: ...


class Outcome(Enum):
    """What becomes of an event."""

    TAKEN = "taken"
    PASSED = "passed"
    """The session has no use for it: ``left_to_blender`` says whether Blender gets it."""
    FINISH = "finish"
    CANCEL = "cancel"


class PoseControls:
    """Mouse and keys on a session."""

    def __init__(self, session: PuppetSession) -> None:
        self.session = session
        self.hover: int | None = None
        """The body under the mouse."""
        self.message = ""
        """The last thing worth telling."""
        self.hand: Floats | None = None
        """(3,) where the hand is while it holds, world."""
        self._spring: HandSpring | None = None
        self._turn = IDENTITY.copy()
        self._latched = False
        self._turning = False
        self._pixel: tuple[float, float] | None = None

    @property
    def holding(self) -> bool:
        """Whether the hand holds something."""
        return self.hand is not None

    @property
    def held(self) -> HandSpring | None:
        """What the hand holds, be there others or not."""
        return self.session.still_held(self._spring)

    @property
    def help(self) -> tuple[tuple[str, str], ...]:
        return HELP if self.session.measuring is None else MEASURING

    def tick(
        self, seconds: float, others: Mapping[HandSpring, tuple[Floats, Floats]] = _NONE
    ) -> None:
        """Simulate so many seconds, with this hand and others: see ``PuppetSession.tick``."""
        core = self.session.core
        if core.said:
            self.message, core.said = core.said, ""
        if self.session.measuring is not None:
            self.session.tick(seconds, self.hand)
            return
        held = self.held
        if held is None:
            # A change of frame may have taken the puppet out of the hand.
            self._lose()
        hands = dict(others)
        if held is not None and self.hand is not None:
            hands[held] = self.hand, self._turn
        self.session.tick(seconds, hands=hands)

    def handle(self, event: Any, view: EyeOn | None, x: float = 0.0, y: float = 0.0) -> Outcome:
        """One of Blender's events, or the like, at pixels x and y of the viewport under the mouse,
        if any.
        """
        kind, press = event.type, event.value == "PRESS"
        if kind == "LEFTMOUSE" and event.value == "RELEASE" and self.holding and not self._latched:
            # Wherever the button is let go.
            self._let_go()
            return Outcome.TAKEN
        if view is None:
            self.hover = None if not self.holding else self.hover
            return Outcome.PASSED
        if kind == "MOUSEMOVE":
            self._move(view, x, y, fine=event.shift)
            return Outcome.TAKEN if self.holding else Outcome.PASSED
        if kind in _PASSED or (event.alt and kind == "LEFTMOUSE"):
            return Outcome.PASSED
        if kind in {"WHEELUPMOUSE", "WHEELDOWNMOUSE"}:
            return self._wheel(view, 1.0 if kind == "WHEELUPMOUSE" else -1.0, event)
        if kind == "R" and event.value == "RELEASE":
            self._turning = False
            return Outcome.TAKEN
        if not press:
            return Outcome.PASSED
        if self.session.measuring is not None:
            return self._press_measuring(self.session.measuring, event, view, x, y)
        return self._press(event, view, x, y)

    def _press_measuring(
        self, measuring: MeasuringHand, event: Any, view: EyeOn, x: float, y: float
    ) -> Outcome:
        session, kind = self.session, event.type
        if kind == "LEFTMOUSE":
            hit = self._look(view, x, y)
            if hit is None or not measuring.takes(hit.body):
                self.message = phrase(
                    "Drag {bone}, which is measured", bone=session.bone(measuring.body)
                )
                return Outcome.TAKEN
            measuring.grab(hit.point)
            self.hand, self._pixel = hit.point / session.unit, (x, y)
        elif kind in {"ESC", "RIGHTMOUSE"}:
            self.hand = None
            session.drop_measure()
            self.message = "Not measured"
        elif kind in {"M", "RET", "NUMPAD_ENTER"}:
            self.hand = None
            measuring.release()
            try:
                self.message = session.take_measure(bone_only=kind == "M" and event.shift)
            except OctoMotionError as error:
                # Another drag may put it right.
                session.drop_measure()
                self.message = as_phrase(error)
        elif kind not in _OWN:
            return Outcome.PASSED
        return Outcome.TAKEN

    def _measure(self) -> str:
        body = self._pointed_at()
        if body is None:
            return phrase("Point at a limb to measure its joint")
        self._lose()
        self.session.measure(body)
        return ""

    def _press(self, event: Any, view: EyeOn, x: float, y: float) -> Outcome:
        kind = event.type
        if kind == "ESC":
            return Outcome.CANCEL
        if kind in {"RET", "NUMPAD_ENTER"}:
            return Outcome.FINISH
        if kind == "RIGHTMOUSE":
            if not self.holding:
                return Outcome.PASSED
            self._let_go(keep=False)
            return Outcome.TAKEN
        if kind == "LEFTMOUSE":
            if self._latched:
                self._let_go()
                return Outcome.TAKEN
            return self._take(view, x, y)
        if _modified(event) and kind != "Z":
            # Opening files and the like is Blender's; what else it does to a pose can wait.
            return Outcome.TAKEN if kind in _OWN - {"O"} or kind == "M" else Outcome.PASSED
        if kind in _ARROWS and not event.shift:
            scene = self.session.scene()
            go_to(scene, scene.frame_current + _ARROWS[kind])
            return Outcome.TAKEN
        return self._key(event, view, x, y)

    def _key(self, event: Any, view: EyeOn, x: float, y: float) -> Outcome:
        session, kind = self.session, event.type
        if kind == "G":
            if self.holding:
                self._let_go()
            elif self._take(view, x, y) is Outcome.TAKEN:
                self._latched = True
        elif kind == "P":
            body = self._pointed_at()
            self.message = "Point at a limb to pin it" if body is None else session.toggle_pin(body)
        elif kind == "K":
            self._try(lambda: session.words_for(session.key(all_bones=event.shift)))
        elif kind == "O":
            self._try(session.toggle_record)
        elif kind == "M":
            self._try(self._measure)
        elif kind == "R":
            if self.holding:
                self._turning = True
            else:
                session.restore()
                self.message = "As at the start"
        elif kind == "Z" and _modified(event) and not event.alt:
            self._lose()
            self.message = undone(session, forward=event.shift)
        else:
            return Outcome.PASSED
        return Outcome.TAKEN

    # --- The hand -------------------------------------------------------------------------------

    def _take(self, view: EyeOn, x: float, y: float) -> Outcome:
        hit = self._look(view, x, y)
        if hit is None:
            return Outcome.PASSED
        self._spring = self.session.take(hit.body, hit.point)
        self.hand = hit.point / self.session.unit
        self._turn = IDENTITY.copy()
        self._pixel = x, y
        self._turning = False
        self.message = ""
        return Outcome.TAKEN

    def _lose(self) -> None:
        """The hand holds nothing any more."""
        self._latched = self._turning = False
        self.hand = None

    def _let_go(self, *, keep: bool = True) -> None:
        self._lose()
        if self.session.measuring is not None:
            self.session.measuring.release()
            return
        if keep:
            self._try(self._release)
        else:
            self.session.step_back()

    def _release(self) -> str:
        keyed = self.session.release(self._spring)
        return self.session.words_for(keyed) if keyed else self.message

    def _pointed_at(self) -> int | None:
        """The body that the hand holds, or else the one under the mouse."""
        held = self.held
        return self.hover if held is None else held.body

    def _look(self, view: EyeOn, x: float, y: float) -> Hit | None:
        origin, way = view.ray(x, y)
        return self.session.pick(origin, way, margin=MARGIN)

    def _move(self, view: EyeOn, x: float, y: float, *, fine: bool) -> None:
        if not self.holding or self._pixel is None:
            hit = self._look(view, x, y)
            self.hover = None if hit is None else hit.body
            return
        assert self.hand is not None
        (old_x, old_y), self._pixel = self._pixel, (x, y)
        share = FINE if fine else 1.0
        if self._turning:
            right, up, _ = view.axes().T
            angle = share * TURN_PER_PIXEL
            turn = multiply(
                from_axis_angle(up, angle * (x - old_x)),
                from_axis_angle(right, angle * (old_y - y)),
            )
            self._turn = multiply(turn, self._turn)
            return
        way = view.at_depth(x, y, self.hand) - view.at_depth(old_x, old_y, self.hand)
        self.hand = self.hand + share * way

    def _wheel(self, view: EyeOn, notches: float, event: Any) -> Outcome:
        measuring = self.session.measuring
        if measuring is not None:
            measuring.pull = max(measuring.pull + notches * PULL_STEP, PULL_STEP)
            return Outcome.TAKEN
        if self.hand is None:
            return Outcome.PASSED
        towards = view.axes()[:, 2]
        share = notches * (FINE if event.shift else 1.0)
        if event.ctrl:
            self._turn = multiply(from_axis_angle(towards, share * TURN_STEP), self._turn)
        else:
            self.hand = self.hand - share * DEPTH_STEP * self.session.size * towards
        return Outcome.TAKEN

    def _try(self, do: Callable[[], str]) -> None:
        """Do what may fail, and tell what came of it: nothing else is lost by that."""
        try:
            self.message = do()
        except OctoMotionError as error:
            self.message = as_phrase(error)

    def status(self) -> str:
        """One line about the session, for the header."""
        session = self.session
        parts: list[str] = [phrase("Posing {puppet}", puppet=session.puppet.name)]
        measuring = session.measuring
        if measuring is not None:
            bone, angle = session.bone(measuring.body), np.degrees(measuring.angle)
            step = phrase("stays") if measuring.shown else phrase("bends")
            parts.append(
                phrase(
                    "Measuring {bone}: pulled by {pull:.2f} of what hangs on it, {step} "
                    "{angle:.0f}°",
                    bone=bone,
                    pull=measuring.pull,
                    step=step,
                    angle=angle,
                )
            )
        elif (held := self.held) is not None:
            bone = session.bone(held.body)
            parts.append(
                phrase(
                    "{bone}: pulled by {pull:.2f} of the figure's weight",
                    bone=bone,
                    pull=session.pull(held),
                )
            )
        elif self.hover is not None:
            parts.append(phrase("{bone}", bone=session.bone(self.hover)))
        if session.recording:
            parts.append(phrase("● Recording"))
        report = session.report
        if report is not None and not report.resting and report.ratio < SLOW:
            parts.append(phrase("slower than real time: {ratio:.0f} %", ratio=100.0 * report.ratio))
        parts += [each for each in (self.message, session.missed, session.warning) if each]
        return joined_phrases("    ", parts)


class Undoable(Protocol):
    """A session, or the hands at a device that pose it."""

    def step_back(self) -> bool: ...

    def step_forward(self) -> bool: ...


def undone(what: Undoable, *, forward: bool) -> str:
    """Take a step back or forward; what was done, in words."""
    if forward:
        return phrase("Forward") if what.step_forward() else phrase("Nothing to bring back")
    return phrase("Back") if what.step_back() else phrase("Nothing to take back")


def _modified(event: Any) -> bool:
    return event.ctrl or event.alt or getattr(event, "oskey", False)


SLOW: Final = 0.9
"""Simulated against real time, below which the header says so."""
