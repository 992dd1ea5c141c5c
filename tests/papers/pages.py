# SPDX-License-Identifier: GPL-3.0-or-later
"""What of the papers is shown again: by what name, after which figure, with which measurement.

``make papers`` prints these as a table, and ``docs/papers.md`` is made from them: figures come from
``figures.json`` beside this, pictures from ``docs/images/papers``.
"""

from __future__ import annotations

import importlib
import json
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from tests.bench.pages import machine, rounded, told

REPOSITORY: Final = Path(__file__).resolve().parents[2]
FIGURES: Final = Path(__file__).with_name("figures.json")
PAGE: Final = REPOSITORY / "docs" / "papers.md"
IMAGES: Final = "images/papers"
"""Where pictures are, from the page."""
OCTOPUS, PLASTIC, SPLICE = "octopus", "plastic", "splice"


@dataclass(frozen=True)
class Experiment:
    """One experiment or figure of a paper."""

    paper: str
    where: str
    """Figures, equations or sections of the paper."""
    theirs: str
    """What the paper shows or says."""
    ours: str = ""
    """What we show, where a measurement does not say it."""
    measure: str = ""
    """``module.function`` of these measurements; ``module.function_told`` puts it into words, and
    ``module.function_text`` is a table, if there are such."""
    alt: str = ""
    """What the picture shows; none: there is no picture."""

    def found(self, *, quick: bool) -> Any:
        """What is measured now; none where it needs data that are not here."""
        return self._function("")(quick=quick) if self.measure else None

    def said(self, figures: Any) -> str:
        """What we show, in words."""
        words = self._function("_told")(figures) if figures is not None else ""
        return ". ".join(each for each in (self.ours, words) if each)

    def table(self, figures: Any) -> str:
        """A table of figures, if there is one."""
        module, function = self._place()
        text = getattr(module, f"{function}_text", None)
        return text(figures) if text and figures is not None else ""

    def _function(self, suffix: str) -> Callable[..., Any]:
        module, function = self._place()
        return getattr(module, function + suffix)

    def _place(self) -> tuple[Any, str]:
        module, _, function = (self.measure or "octopus.none").partition(".")
        return importlib.import_module(f"tests.papers.{module}"), function


EXPERIMENTS: Final[dict[str, Experiment]] = {
    "spheres": Experiment(
        OCTOPUS,
        "fig. 3.1, 3.2",
        "an arm of twelve joints as spheres, and the octopus of eight such arms, 45° apart",
        measure="octopus.build",
        alt="One arm of spheres, and eight of them under a head, from above and from the side",
    ),
    "ccd": Experiment(
        OCTOPUS,
        "fig. 3.3, 3.4",
        "the last joint turns until the error is least, then the one before",
        "the same, and where a whole sweep leaves the arm",
        alt="Three moments of one sweep of the heuristic method on an arm of six joints",
    ),
    "targets": Experiment(
        OCTOPUS,
        "fig. 3.5",
        "three groups of joints converge to three pseudo-targets",
        "the source's loop beside ours, at one moment of the walk",
        alt="Arms whose three groups of joints end at the pseudo-targets, by both ways",
    ),
    "phases": Experiment(
        OCTOPUS,
        "fig. 3.6, 3.7",
        "one arm through a cycle of the walk, and of the swim",
        "eight phases of each: the source's loop above, ours below",
        alt="One arm in eight phases of the walk and of the swim, by both ways",
    ),
    "walk": Experiment(
        OCTOPUS,
        "fig. 4.1–4.7",
        "seven moments of an octopus that walks",
        "above as published, with all that is ours switched off: nothing stands on the ground; "
        "below as it comes",
        alt="An octopus in seven moments of its walk, as published and as it comes",
    ),
    "swim": Experiment(
        OCTOPUS,
        "fig. 4.8–4.11",
        "key poses of the swim: arms raised, arms beaten down, streamlined, roots raised",
        "above as published, below as it comes, at the same phases",
        alt="An octopus in the four key poses of its swim, as published and as it comes",
    ),
    "loop": Experiment(
        OCTOPUS,
        "§3.1.2, §5",
        "the method converges fast enough for interactive use; no figures",
        measure="octopus.loop",
    ),
    "weights": Experiment(
        OCTOPUS,
        "eq. 3.7",
        "a weight near 0 lets joints near the root turn more, near 1 those near the tip",
        measure="octopus.weights",
        alt="An arm with three profiles of weights at four moments of the walk, by both ways",
    ),
    "change": Experiment(
        OCTOPUS,
        "§4.2",
        "an open problem: the change between walking and swimming",
        measure="octopus.change",
        alt="An octopus walks along a route and swims off where it rises",
    ),
    "suckers": Experiment(
        OCTOPUS,
        "§4.2",
        "an open problem: twist, and which way the suckers face",
        measure="octopus.suckers",
        alt="An arm in three cycles of a walk; its suckers' side wanders round it by the source's "
        "loop, and stays below by ours",
    ),
    "keyed": Experiment(
        OCTOPUS,
        "abstract, §4",
        "hand-keyed and generated motion compared in quality and work; no figures",
        measure="keyed.keyed",
    ),
    "element": Experiment(
        PLASTIC,
        "fig. 5",
        "0.1 kg on the three elements, pushed for a while: a part springs back, a part stays",
        measure="plastic.element",
        alt="Displacement, velocity and force over time, by the closed form and by three steps",
    ),
    "solver": Experiment(
        PLASTIC,
        "§4.1, §4.2",
        "Gauss–Seidel, started from the step before, is stable with few sweeps",
        measure="plastic.solver",
    ),
    "puppet": Experiment(
        PLASTIC,
        "§3, §5.2",
        "joints resist bending and twist; other things in the space push back",
        measure="plastic.puppet",
        alt="A wooden doll whose arm is bent, twisted and pushed into a box, and curves of the "
        "force and torque on the hand",
    ),
    "hand": Experiment(
        PLASTIC,
        "§5.2, §6",
        "with force, twisting a doll into a pose is easier; a quantitative evaluation is left open",
        measure="hands.hand",
    ),
    "steps": Experiment(
        SPLICE,
        "fig. 1",
        "part, timing, splice; again until it is right; the result is the next base",
        "the same order, and the buttons for it",
        alt="The five steps of the paper, one after another, and what they are in the panel",
    ),
    "two_stage": Experiment(
        SPLICE,
        "fig. 2",
        "features of the right arm from the chest's centre, restored places, two triangles",
        "the same, drawn from a walk and a throw",
        alt="A person of lines three times: vectors from the chest to elbow and hand, the same on "
        "the walking body, and both triangles with their normals",
    ),
    "timings": Experiment(
        SPLICE,
        "fig. 3–5",
        "a walk takes on a right arm that turns, and a left one that punches, at two timings",
        "the same, with the project's own clips; recorded ones where there are some",
        alt="Rows of poses: walk, turning arm, punch, and both arms on the walk at two timings",
    ),
    "parts": Experiment(
        SPLICE,
        "§2",
        "five parts: both arms, legs, trunk, head",
        "each of the five on one walk",
        alt="Rows of poses of a walk with the right arm, the left arm, the legs, the trunk and the "
        "head of other clips, in orange",
    ),
    "ways": Experiment(
        SPLICE,
        "§1, §4",
        "upper on lower bodies (Heck, Kovar and Gleicher) need lower bodies that are alike; parts "
        "do not; timing matters. No figures",
        measure="splices.ways",
    ),
}
"""By name, in the order of the papers."""


def read() -> dict[str, Any]:
    """All figures that are kept, by experiment."""
    return json.loads(FIGURES.read_text(encoding="utf-8")) if FIGURES.exists() else {}


def measured(names: Iterable[str], *, quick: bool = False) -> dict[str, Any]:
    """The figures of some experiments, measured now, by name, with when and where."""
    where, found = machine(), {}
    for name in names:
        figures = EXPERIMENTS[name].found(quick=quick)
        if figures is not None:
            found[name] = {"run": where, "figures": rounded(figures)}
    return found


def keep(found: dict[str, Any]) -> None:
    """Keep figures, and write the page from all that are kept."""
    everything = read() | found
    ordered = {name: everything[name] for name in EXPERIMENTS if name in everything}
    FIGURES.write_text(json.dumps(ordered, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), ordered), encoding="utf-8")


_MARKED: Final = re.compile(r"<!-- paper: (?P<name>\w+) -->.*?<!-- end of paper -->", re.DOTALL)


def filled(text: str, kept: dict[str, Any]) -> str:
    """The page with everything between its marks made from the figures that are kept."""
    return _MARKED.sub(lambda found: block(found["name"], kept), text)


def block(paper: str, kept: dict[str, Any]) -> str:
    """What stands between the marks of a paper, marks included."""
    chosen = {name: each for name, each in EXPERIMENTS.items() if each.paper == paper}
    rows = [
        f"| {each.where} | {each.theirs} | {_cell(each.said(_figures(name, kept)))} | "
        f"`make papers ARGS={name}` |"
        for name, each in chosen.items()
    ]
    parts = ["| There | In the paper | Ours | Made by |\n|---|---|---|---|\n" + "\n".join(rows)]
    for name, each in chosen.items():
        table = each.table(_figures(name, kept))
        if not each.alt and not table:
            continue
        parts.append(f"### {_sentence(each.where)}: {name.replace('_', ' ')}")
        if each.alt:
            parts.append(f"![{each.alt}]({IMAGES}/{name}.png)")
        if table:
            lines = "\n".join(line.rstrip() for line in table.splitlines())
            parts += [told(kept[name]["run"]), f"```text\n{lines}\n```"]
    return "\n\n".join([f"<!-- paper: {paper} -->", *parts, "<!-- end of paper -->"])


def _figures(name: str, kept: dict[str, Any]) -> Any:
    return kept[name]["figures"] if name in kept else None


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:]


def printed(found: dict[str, Any], pictures: dict[str, Path]) -> str:
    """One table of everything that was made: paper's figure, what it is, what ours comes to."""
    lines = []
    for name, each in EXPERIMENTS.items():
        if name not in found and name not in pictures:
            continue
        lines += [
            f"[{_sentence(each.paper)}] {each.where}: {each.theirs}",
            f"    ours: {each.said(_figures(name, found))}",
            *([f"    {pictures[name]}"] if name in pictures else []),
        ]
        table = each.table(_figures(name, found))
        lines += [f"    {line}".rstrip() for line in table.splitlines()]
    return "\n".join(lines)
