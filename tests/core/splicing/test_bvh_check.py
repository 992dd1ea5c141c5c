# SPDX-License-Identifier: GPL-3.0-or-later
"""Damaged BVH files are refused with the line; what can be read in one way only is repaired."""

import codecs
from collections.abc import Callable

import hypothesis.strategies as st
import pytest
from hypothesis import given

from octo_motion.core.errors import ClipError
from octo_motion.core.splicing.clip.bvh_check import check_bvh

SOUND = """HIERARCHY
ROOT hip
{
\tOFFSET 0.0 0.0 0.0
\tCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
\tJOINT chest
\t{
\t\tOFFSET 0.0 10.0 0.0
\t\tCHANNELS 3 Zrotation Xrotation Yrotation
\t\tEnd Site
\t\t{
\t\t\tOFFSET 0.0 5.0 0.0
\t\t}
\t}
}
MOTION
Frames: 2
Frame Time: 0.05
1.0 2.0 3.0 10.5 -20.25 30.0 1e-3 .5 6.
4.0 5.0 6.0 11.0 -21.0 31.0 7.0 8.0 9.0
"""


def changed(old: str, new: str) -> bytes:
    assert old in SOUND
    return SOUND.replace(old, new).encode()


def frames_and_joints(text: str) -> tuple[int, int]:
    """What the plain text of a file says and has."""
    hierarchy, _, rest = text.partition("MOTION\nFrames: ")
    return int(rest.split()[0]), hierarchy.count("CHANNELS")


def test_a_sound_file_keeps_its_numbers_to_the_digit() -> None:
    checked = check_bvh(SOUND.encode())

    assert checked.notes == ()
    assert frames_and_joints(checked.text) == (2, 2)
    assert checked.rate == pytest.approx(20.0, rel=1e-12)
    assert "1.0 2.0 3.0 10.5 -20.25 30.0 1e-3 .5 6." in checked.text
    # Its plainest form is a sound file again, and the same.
    assert check_bvh(checked.text.encode()).text == checked.text


SAME_MOTION: dict[str, Callable[[str], bytes]] = {
    "mark of UTF-8": lambda text: codecs.BOM_UTF8 + text.encode(),
    "UTF-16, little end first": lambda text: codecs.BOM_UTF16_LE + text.encode("utf-16-le"),
    "UTF-16, big end first": lambda text: codecs.BOM_UTF16_BE + text.encode("utf-16-be"),
    "UTF-16 without a mark": lambda text: text.encode("utf-16-le"),
    "UTF-16 without a mark, big end first": lambda text: text.encode("utf-16-be"),
    "line ends of Windows": lambda text: text.replace("\n", "\r\n").encode(),
    "line ends of old Macs": lambda text: text.replace("\n", "\r").encode(),
    "blank lines": lambda text: text.replace("\n", "\n\n \n").encode(),
    "tabs": lambda text: text.replace(" ", "\t").encode(),
    "small letters": lambda text: text.lower().encode(),
    "capitals": lambda text: text.replace("End Site", "END SITE").encode(),
    "brace beside the name": lambda text: (
        text.replace("\n\t{", " {").replace("hip\n", "hip ").encode()
    ),
    "zero bytes at the end": lambda text: (text + "  \n\0\0").encode(),
    "a remark at the end": lambda text: (text + "# made by hand\n").encode(),
    "decimal commas": lambda text: text.replace(" .5 6.", " 0,5 6").replace(".", ",").encode(),
}


@pytest.mark.parametrize("how", SAME_MOTION)
def test_the_same_motion_written_otherwise_is_the_same_motion(how: str) -> None:
    expected, found = check_bvh(SOUND.encode()), check_bvh(SAME_MOTION[how](SOUND))

    def values(text: str) -> list[float]:
        rows = text.split("Frame Time:")[1].splitlines()[1:]
        return [float(word) for row in rows for word in row.split()]

    assert frames_and_joints(found.text) == (2, 2)
    assert found.rate == expected.rate
    assert values(found.text) == values(expected.text)


DAMAGED = {
    "nothing in it": (b"", "is empty"),
    "blanks alone": (b" \n\0 \n", "is empty"),
    "something else": (b"Kaydara FBX Binary", "Line 1: this is not a BVH file"),
    "no root": (b"HIERARCHY\nMOTION\nFrames: 1", "there is no ROOT"),
    "no motion": (SOUND.split("MOTION", maxsplit=1)[0].encode(), "Line 15: .* there is no MOTION"),
    "ends within": (SOUND.split("End Site", maxsplit=1)[0].encode(), "Line 9: the file ends"),
    "a brace lacks": (changed("\t}\n}\nMOTION", "\t}\nMOTION"), "Line 15: MOTION comes before"),
    "an offset lacks": (changed("\tOFFSET 0.0 0.0 0.0\n", ""), "Line 4: .* OFFSET should"),
    "an offset of two": (changed("0.0 10.0 0.0", "0.0 10.0"), "Line 8: there are 2 numbers"),
    "wrong count of channels": (changed("CHANNELS 3", "CHANNELS 4"), "Line 9: CHANNELS does not"),
    "unknown channel": (changed("3 Zrotation", "3 Wrotation"), "Line 9: 'Wrotation' is no channel"),
    "a channel twice": (changed("3 Zrotation", "3 Xrotation"), "Line 9: a channel is there twice"),
    "no number of frames": (changed("Frames: 2", "Frames: many"), "Line 17: 'Frames: many'"),
    "no frame time": (changed("Frame Time: 0.05\n", ""), "Line 18: .* 'Frame Time:'"),
    "frame time of zero": (changed("Time: 0.05", "Time: 0"), "Line 18: the frame time is 0"),
    "negative frame time": (changed("Time: 0.05", "Time: -0.05"), "Line 18: the frame time is -0"),
    "tiny frame time": (changed("Time: 0.05", "Time: 0.0001"), "Line 18: .* 10000 frames a second"),
    "infinite frame time": (changed("Time: 0.05", "Time: inf"), "Line 18: 'inf' is not a finite"),
    "no frames": (SOUND.split("1.0 2.0", maxsplit=1)[0].encode(), "Line 18: there are no frames"),
    "not a number": (changed("-20.25", "NaN"), "Line 19: 'NaN' is not a finite number"),
    "infinite": (changed("31.0", "1.#INF"), "Line 20: '1.#INF' is not a finite number"),
    "too large": (changed("31.0", "1e999"), "Line 20: '1e999' is not a finite number"),
    "two numbers in one": (changed("3.0 10.5", "3.0-10.5"), "Line 19: '3.0-10.5' is no number"),
    "one value less": (changed("4.0 5.0 ", "4.0 "), "Line 20: there are 8 numbers instead of 9"),
    "a word in the motion": (changed("4.0", "four"), "Line 20: 'four' is no number"),
    "zero bytes within": (changed("-20.25", "-20\0"), "Line 19: there are zero bytes"),
    "half of UTF-16": (codecs.BOM_UTF16_LE + b"HIE", "begins like UTF-16"),
}


@pytest.mark.parametrize("how", DAMAGED)
def test_a_damaged_file_is_refused_with_the_line(how: str) -> None:
    content, message = DAMAGED[how]
    with pytest.raises(ClipError, match=message):
        check_bvh(content)


def test_a_wrong_count_of_frames_is_told_and_all_frames_are_kept() -> None:
    checked = check_bvh(changed("Frames: 2", "Frames: 7"))
    assert frames_and_joints(checked.text) == (2, 2)
    assert checked.notes == ("It says that it has 7 frames, but has 2.",)


def test_names_in_an_old_encoding_are_told() -> None:
    checked = check_bvh(SOUND.replace("chest", "poitrine_é").encode("latin-1"))
    assert "poitrine_é" in checked.text
    assert "not in UTF-8" in checked.notes[0]


@pytest.mark.parametrize(
    ("encoding", "note"),
    [
        ("utf-8", ()),
        ("utf-8-sig", ()),
        ("utf-16", ("Its text was UTF-16-LE.",)),
        ("cp932", ("Its names are not in UTF-8: they were read as Shift-JIS.",)),
        ("euc_jp", ("Its names are not in UTF-8: they were read as EUC-JP.",)),
    ],
)
@pytest.mark.parametrize(
    "names",
    [
        ("右腕", "左ひじ"),
        ("センター", "上半身"),
        ("頭", "首"),
        ("足首", "左手首"),
        ("右ひざ", "下半身"),
        ("RightArm_腕", "つま先"),
    ],
)
def test_japanese_names_are_read_right(
    encoding: str, note: tuple[str, ...], names: tuple[str, str]
) -> None:
    text = SOUND.replace("hip", names[0]).replace("chest", names[1])
    checked = check_bvh(text.encode(encoding))
    assert f"ROOT {names[0]}\n" in checked.text
    assert f"JOINT {names[1]}\n" in checked.text
    assert checked.notes == note


@pytest.mark.parametrize("name", ["poitrine_é", "épaule", "Hüfte", "Señor", "bröst"])
def test_names_in_latin_letters_are_not_taken_for_japanese(name: str) -> None:
    assert f"JOINT {name}\n" in check_bvh(SOUND.replace("chest", name).encode("latin-1")).text


def hierarchy_and_rows(text: str) -> tuple[list[str], list[list[str]]]:
    """Lines that name channels, and the values of all frames."""
    hierarchy, _, motion = text.partition("MOTION\n")
    lines = [line for line in hierarchy.splitlines() if line.startswith("CHANNELS")]
    return lines, [row.split() for row in motion.splitlines()[2:]]


@pytest.mark.parametrize(
    ("channels", "row", "plain", "values"),
    [
        ("1 Xrotation", "7", "3 Xrotation Yrotation Zrotation", ["7", "0", "0"]),
        ("1 Zrotation", "7", "3 Zrotation Xrotation Yrotation", ["7", "0", "0"]),
        ("2 Zrotation Xrotation", "7 8", "3 Zrotation Xrotation Yrotation", ["7", "8", "0"]),
        ("0", "", "0", []),
        (
            "2 Yposition Xrotation",
            "7 8",
            "6 Yposition Xrotation Xposition Zposition Yrotation Zrotation",
            ["7", "8", "1.5", "2.5", "0", "0"],
        ),
    ],
)
def test_a_joint_of_fewer_axes_gets_the_others_standing_still(
    channels: str, row: str, plain: str, values: list[str]
) -> None:
    """What does not turn is at 0, and what does not move stays as far off as the file says."""
    text = SOUND.replace("OFFSET 0.0 10.0 0.0", "OFFSET 1.5 10.0 2.5")
    text = text.replace("3 Zrotation Xrotation Yrotation", channels)
    root = "1 2 3 4 5 6"
    text = text[: text.index("1.0 2.0")] + f"{root} {row}\n{root} {row}\n"
    checked = check_bvh(text.encode())
    lines, rows = hierarchy_and_rows(checked.text)
    assert lines[1] == f"CHANNELS {plain}"
    assert rows == [[*root.split(), *values]] * 2
    assert checked.notes == ()


def test_only_joints_of_fewer_axes_get_more() -> None:
    """The root between has all of its own, and what follows keeps its columns."""
    text = SOUND.replace("CHANNELS 6 Xposition Yposition Zposition ", "CHANNELS 3 ")
    text = text.replace("CHANNELS 3 Zrotation Xrotation", "CHANNELS 2 Zrotation Xrotation", 1)
    text = text.replace("Xrotation Yrotation\n\tJOINT", "Xrotation\n\tJOINT")
    text = text[: text.index("1.0 2.0")] + "1 2 3 4 5\n6 7 8 9 10\n"
    _, rows = hierarchy_and_rows(check_bvh(text.encode()).text)
    assert rows == [["1", "2", "0", "3", "4", "5"], ["6", "7", "0", "8", "9", "10"]]


PIECES = ["{", "}", "\n", "MOTION\n", "JOINT x\n", "End Site\n", "nan", " ", "\0", ",", "é", "#"]


@given(
    edits=st.lists(
        st.tuples(
            st.integers(0, len(SOUND)), st.integers(0, 40), st.sampled_from([*PIECES, "", ""])
        ),
        min_size=1,
        max_size=4,
    )
)
def test_whatever_is_cut_out_or_put_in_is_understood_or_refused(
    edits: list[tuple[int, int, str]],
) -> None:
    text = SOUND
    for place, length, piece in edits:
        text = text[:place] + piece + text[place + length :]
    try:
        checked = check_bvh(text.encode())
    except ClipError:
        return
    again = check_bvh(checked.text.encode())
    assert (again.text, again.notes) == (checked.text, ())
