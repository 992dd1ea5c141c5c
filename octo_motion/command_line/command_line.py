# SPDX-License-Identifier: GPL-3.0-or-later
"""The words of the command line; no Blender is needed to read them."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from .quality_limits import NAMES
from .shot_request import EXPORT_SUFFIXES, HIGHEST_FPS, MOST_FRAMES

COMMAND: Final = "octo_motion"
"""Name of the command."""

_STATUS: Final = "Exit status: 0 all went well, 1 something failed, 2 wrong arguments or job."

_GENERATE: Final = """\
Let one armature walk or swim along a curve, and save the result as a new file.

What is not given is as it is set in the file. The file that is read stays as it is, unless
--overwrite is given; an output is written whole or not at all.
"""

_SPLICE: Final = """\
Put parts of other motions onto one motion, and save the result as a new file.

FILE is the motion to splice onto: a motion file (.bvh, .fbx, .glb, .gltf), or a .blend file with
an armature and its action. Each --splice goes onto the result of those before it; without any, the
list that the .blend file has is built. What is read stays as it is.

  splice walk.bvh --splice right_arm throw.bvh base_start=20 after=stop \\
         --splice left_arm punch.bvh base_start=60 mode=exact -o walk_throw_punch.blend

What is not given has the value that the panel gives to a new splice. Settings have the names that
scripts use: Object.octo_motion.splicing.splices[N].NAME. clip=FILE, action=NAME and source=NAME (an
armature of the .blend file) say where the part is from; landmarks.NAME=BONE says which bone is
which, where it cannot be told.
"""

_POSE: Final = """\
Pose an armature by a script of grabs, pulls, pins and keys, and save the result as a new file.

The script is a JSON file, as it is described in the scripting reference. The same script gives the
same keys each time, on the same computer. The file that is read stays as it is, unless --overwrite
is given; an output is written whole or not at all.
"""

_BAKE: Final = """\
Make many shots from a job file, each in a process of its own.

The whole job is checked before anything runs. A shot that fails is reported with its reason and
does not stop the others. Run again, only what is new or has changed is made.
"""

_JOB: Final = """\
A job file is TOML; its paths are relative to its folder. [defaults] is for all shots.

  [defaults]
  fps = 25
  output = "shots/{name}.blend"
  settings = { timing = "SPEED", speed = 0.4 }
  limits = { slip = 0.01, depth = 0.005, turn = 45.0 }   # worse, and the shot fails

  [[shots]]
  name = "along_the_wall"
  file = "reef.blend"               # the scene; its armature and curve by name
  armature = "Octopus"              # if there are several
  route = "Wall"                    # default: the armature's own
  ground = "Sea Floor"              # the mesh to walk on; default: its own
  gait = "walk"                     # or a gait file, "gaits/sneak.json"

  [[shots]]
  name = "newcomer"
  octopus = { arms = 8, arm_length = 0.5 }                    # a new one in an empty scene
  route = [[0, 0, 0], [0, -2, 0], [1, -3, 0.5], [3, -3, 1]]   # four control points
  # or: route = { points = [[0, 0, 0], [1, -1, 0], …], cyclic = true }
  gait = "swim"
  settings = { variation_max = "5°", table.stride = 1.2 }
  export = ["shots/newcomer.glb", "shots/newcomer.abc"]

Settings have the names that scripts use: Object.octo_motion.locomotion.NAME. Numbers of angles are
radians, texts may be in degrees.

  [[shots]]
  name = "walk_and_throw"
  kind = "splice"                   # parts of other motions onto this one
  file = "clips/walk.bvh"           # or a .blend file, with armature and base (an action) by name
  splices = [
      { part = "right_arm", clip = "clips/throw.bvh", base_start = 20, after = "stop" },
      { part = "left_arm", clip = "clips/punch.bvh", base_start = 60, mode = "exact" },
  ]
"""


def parser(program: str, *, has_open_file: bool) -> argparse.ArgumentParser:
    """The parser of all commands.

    Args:
        program: how it is called, for its help.
        has_open_file: whether the file may be left out because Blender has one open.
    """
    main = argparse.ArgumentParser(
        prog=program,
        description="Octo Motion: creatures with arms walk and swim along a route, parts of one "
        "motion are put onto another, figures are posed like puppets.",
        epilog=f"{_STATUS} '{program} bake --help' shows what a job file looks like.",
    )
    commands = main.add_subparsers(dest="command", required=True, metavar="COMMAND")
    _add_generate(commands, has_open_file=has_open_file)
    _add_splice(commands, has_open_file=has_open_file)
    _add_pose(commands, has_open_file=has_open_file)
    _add_bake(commands)
    return main


def _add_generate(
    commands: argparse._SubParsersAction[argparse.ArgumentParser], *, has_open_file: bool
) -> None:
    command = commands.add_parser(
        "generate",
        help="let the armature of one file walk or swim",
        description=_GENERATE,
        epilog=_STATUS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    _add_files(command, "the .blend file to read", "the creature", has_open_file=has_open_file)
    command.add_argument(
        "--armature", metavar="NAME", default="", help="default: the one that has arms"
    )
    command.add_argument(
        "--route", metavar="NAME", default="", help="the curve; default: the armature's own"
    )
    command.add_argument(
        "--ground", metavar="NAME", default="", help="the mesh to walk on; default: its own"
    )
    command.add_argument(
        "--gait", metavar="NAME", default="", help="a gait by name, or a gait file (.json)"
    )
    _add_settings(command, "a setting, such as speed=0.4, sway=12° or table.stride=1.2")
    command.add_argument(
        "--limit",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        dest="limits",
        help=f"write nothing if a figure of the motion ({', '.join(NAMES)}) is above; "
        "may be repeated",
    )


def _add_splice(
    commands: argparse._SubParsersAction[argparse.ArgumentParser], *, has_open_file: bool
) -> None:
    command = commands.add_parser(
        "splice",
        help="put parts of other motions onto one motion",
        description=_SPLICE,
        epilog=_STATUS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    _add_files(
        command,
        "the motion or .blend file to splice onto, before any --splice",
        "the armature and what hangs on it",
        has_open_file=has_open_file,
    )
    command.add_argument(
        "--splice",
        metavar=("PART", "FILE NAME=VALUE"),
        nargs="+",
        action="append",
        default=[],
        dest="splices",
        help="a part, the motion file that it is from, and settings; may be repeated",
    )
    command.add_argument(
        "--armature", metavar="NAME", default="", help="default: the one that has splices"
    )
    command.add_argument(
        "--base", metavar="ACTION", default="", help="default: the list's, or the armature's own"
    )
    command.add_argument(
        "--frames",
        metavar="N",
        type=_frame_count,
        help="how long the base lasts: a walk of one cycle is repeated, a longer one is cut",
    )
    _add_settings(command, "a setting of the base, such as visual=true or landmarks.chest=Spine2")


def _add_pose(
    commands: argparse._SubParsersAction[argparse.ArgumentParser], *, has_open_file: bool
) -> None:
    command = commands.add_parser(
        "pose",
        help="pose an armature by a script",
        description=_POSE,
        epilog=_STATUS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    _add_files(command, "the .blend file to read", "the figure", has_open_file=has_open_file)
    command.add_argument(
        "--script", metavar="FILE", type=Path, required=True, help="the pose script (.json)"
    )
    command.add_argument(
        "--armature", metavar="NAME", default="", help="default: the only one, or the active one"
    )
    command.add_argument("--fps", type=_frame_rate, help="frames per second of the scene")


def _add_files(
    command: argparse.ArgumentParser, file: str, exported: str, *, has_open_file: bool
) -> None:
    """What is read and what is written."""
    default = " (default: the one that is open)" if has_open_file else ""
    command.add_argument(
        "file",
        metavar="FILE",
        type=Path,
        nargs="?" if has_open_file else None,
        help=f"{file}{default}",
    )
    command.add_argument(
        "-o", "--output", metavar="FILE", type=Path, help="the .blend file to write"
    )
    command.add_argument(
        "--overwrite",
        action="store_true",
        help="let the output replace a file that is there; without --output the one that is read",
    )
    command.add_argument(
        "--export",
        metavar="FILE",
        type=Path,
        action="append",
        default=[],
        help=f"export {exported} as well ({', '.join(EXPORT_SUFFIXES)}); may be repeated",
    )


def _add_settings(command: argparse.ArgumentParser, what: str) -> None:
    command.add_argument(
        "--set",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        dest="settings",
        help=f"{what}; may be repeated",
    )
    command.add_argument("--fps", type=_frame_rate, help="frames per second of the scene")


def _add_bake(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    command = commands.add_parser(
        "bake",
        help="make many shots from a job file",
        description=_BAKE,
        epilog=f"{_JOB}\n{_STATUS}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("job", metavar="JOB.toml", type=Path, help="the job file")
    command.add_argument(
        "-j",
        "--jobs",
        metavar="N",
        type=_positive,
        help="processes at a time (default: one for each processor, four at most)",
    )
    command.add_argument(
        "--report", metavar="FILE", type=Path, help="default: JOB.report.json beside the job"
    )
    command.add_argument(
        "--force", action="store_true", help="make every shot anew, whatever is there"
    )
    command.add_argument(
        "--shot",
        metavar="NAME",
        action="append",
        default=[],
        dest="only",
        help="only this shot; may be repeated",
    )
    command.add_argument("--check", action="store_true", help="only say what would be done")


def parse(
    arguments: Sequence[str], program: str, *, has_open_file: bool
) -> argparse.Namespace | int:
    """The arguments, or the exit status where there is no more to do."""
    try:
        return parser(program, has_open_file=has_open_file).parse_args(arguments)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 2


def _positive(text: str) -> int:
    number = int(text) if text.isdecimal() else 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number above 0")
    return number


def _frame_count(text: str) -> int:
    number = int(text) if text.isdecimal() else 0
    if not 2 <= number <= MOST_FRAMES:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number from 2 to {MOST_FRAMES}")
    return number


def _frame_rate(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 1.0 <= number <= HIGHEST_FPS:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number from 1 to {HIGHEST_FPS}")
    return number
