# SPDX-License-Identifier: GPL-3.0-or-later
"""The bones of a humanoid that splicing needs to know, and what bones' names say of them.

A name is cut into words ("lForeArm", "mixamorig:LeftForeArm", "forearm_fk.L", "左ひじ"), the
side taken out, and the rest looked up. Some words mean different parts in different rigs ("leg" is
the shin beside "up leg", the thigh beside "shin"): each meaning has a weight, and the chain of
bones decides.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Final, Literal

MIDDLE: Final = ("hips", "spine", "chest", "neck", "head")
"""On the body's mid plane, from the pelvis up. ``spine`` is the lowest bone above the pelvis that
bends the trunk, ``chest`` the one that carries neck and shoulders."""

SIDED: Final = (
    *("clavicle", "upper_arm", "forearm", "hand"),
    *("thigh", "shin", "foot", "toe"),
)
"""On either side: "upper_arm.L" and "upper_arm.R"."""

LANDMARKS: Final = (*MIDDLE, *(f"{name}.{side}" for side in "LR" for name in SIDED))

OPTIONAL: Final = frozenset({"clavicle.L", "clavicle.R", "toe.L", "toe.R", "neck", "spine"})
"""What some rigs do not have; all else is required."""


ReferenceMoment = Literal["", "rest"] | float
"""Where a body's reference pose is found: in all of its clip, at rest, or at a frame of it."""


@dataclass(frozen=True)
class Landmarks:
    """Which bone is which. A bone stands for the joint at its head."""

    bones: Mapping[str, str]
    """Bone name by landmark; optional ones may be missing."""
    reference: ReferenceMoment = ""
    """Where the pose is found in which this body is compared with others."""

    def __getitem__(self, landmark: str) -> str:
        """Name of a landmark's bone; KeyError if the rig has none."""
        return self.bones[landmark]

    def get(self, landmark: str) -> str | None:
        """Name of a landmark's bone, or none."""
        return self.bones.get(landmark)


# --- What the names of bones say: body part, side, and whether a bone is machinery of the rig -----


_WORDS: Final[dict[str, str]] = {
    "hips": "hips hip pelvis cog=.5 center=.6 torso=.5 センター=.7 腰=.9 腰部=.9 下半身=.8 骨盤 "
    "ヒップ becken 髋=.9 "
    "bassin bacino cadera quadril pelvi",
    "spine": "spine abdomen ab lowerback lowback lowerspine spinelower waist=.6 torso=.5 back=.5 "
    "belly=.7 stomach=.7 lumbar 上半身 背骨 脊椎 脊柱 腹=.7 腹部=.7 胴=.5 体幹=.5 "
    "colonne columna coluna colonna",
    "chest": "chest upperchest thorax thoracic=.8 ribcage torso=.6 spineupper upperspine brust "
    "brustkorb 上半身=.5 胸 胸部 胸腔 "
    "poitrine torse=.7 pecho peito petto torace",
    "neck": "neck lowerneck necklower neckbase upperneck=.8 neckupper=.8 cervical=.7 hals "
    "首 頸 頸部 颈 颈部 脖子 "
    "cou cuello pescoco collo",
    "head": "head skull=.7 cranium=.7 kopf 頭 頭部 头 头部 tete cabeza cabeca testa",
    "clavicle": "clavicle collar collarbone clav shoulder=.7 shldr=.4 scapula=.5 "
    "schulter=.7 schlüsselbein 肩 鎖骨 锁骨 肩膀=.7 "
    "clavicule clavicula clavicola epaule=.7 hombro=.7 ombro=.7 spalla=.7",
    "upper_arm": "upperarm uparm uarm armupper arm=.85 shldr=.8 shldrbend shoulder=.6 humerus "
    "oberarm 腕 上腕 上腕部 肩関節 上臂 大臂 "
    "bras brazo braco braccio",
    "forearm": "forearm armlower lowerarm lowarm loarm forearmbend elbow=.95 ulna=.8 radius=.8 "
    "farm unterarm ひじ 肘 肘関節 前腕 前腕部 前臂 小臂 下臂 手肘 "
    "avantbras antebrazo antebraco avambraccio coude=.95 codo=.95 cotovelo=.95 gomito=.95",
    "hand": "hand wrist palm=.5 carpals=.8 手首 手=.9 手関節 手のひら=.5 掌=.5 手腕 手掌=.9 "
    "main=.9 mano mao poignet muneca pulso polso",
    "thigh": "thigh upleg legupper upperleg thighbend femur hip=.65 leg=.5 足=.9 脚=.9 もも 太もも "
    "太腿 大腿 大腿部 股関節 oberschenkel "
    "cuisse muslo coxa coscia",
    "shin": "shin calf leglower lowerleg lowleg loleg knee=.95 leg=.75 tibia shank "
    "unterschenkel ひざ 膝 膝関節 すね 脛 下腿 下腿部 小腿 膝盖 "
    "jambe pierna=.9 perna=.9 gamba=.9 tibia mollet genou=.95 rodilla=.95 joelho=.95 ginocchio=.95",
    "foot": "foot ankle fuss fuß talus=.8 足首 足関節 足=.3 脚=.6 脚踝 脚腕 "
    "pied pie pe=.7 piede cheville tobillo tornozelo caviglia",
    "toe": "toe toes toebase ball forefoot foot=.3 つま先 つまさき 爪先 足先=.8 zehen zeh "
    "脚趾 脚掌=.8 "
    "orteil orteils dedos=.5 punta=.5",
}
"""What each landmark is called, words of a name written together; with a weight where a word means
it only in some rigs. English, German, French, Spanish, Portuguese, Italian, Chinese, Japanese; in
whichever kana, with accents or without."""

_FINGERS: Final = (
    "thumb index mid middle ring pinky little finger fingers fingerbase metacarpal "
    "指 親指 人指 人指し指 人差指 人差し指 中指 薬指 小指"
)
_FACE: Final = "eye eyes jaw tongue teeth brow lip ear ears nose cheek hair breast chin lid 目 両目"
_ENDS: Final = "end nub tip top leaf site effector dummy"
_RIG: Final = (
    "part ik ikp pole target twist roll spin rock tweak mch wgt vis parent socket helper master "
    "widget prop weapon buttock 捩 捩り 腕捩 腕捩り 手捩 手捩り 親 全ての親 操作中心 補助 ダミー"
)
_HIRAGANA: Final = {code: code - 0x60 for code in range(ord("ァ"), ord("ヶ") + 1)}
"""Katakana, which one writes as well for the same word."""
_ACCENTS: Final = dict.fromkeys(range(0x300, 0x370))

_NO_PART: Final = frozenset(f"{_FINGERS} {_FACE} {_ENDS} {_RIG}".translate(_HIRAGANA).split())
"""A name with one of these is no landmark, whatever else it says."""

_CHARACTER: Final = "mixamorig bip biped valvebiped armature metarig character genesis j c cc m b x"
_FILLING: Final = frozenset(f"{_CHARACTER} jnt joint jt bone bn bind rig skeleton skel".split()) | {
    *("def", "org", "fk", "ctrl")
}
"""Says nothing of the body."""

_LEFT: Final = (
    "l left lft links gauche izquierdo izquierda izq esquerdo esquerda sinistro sinistra sx "
    "左 ひだり"
)
_RIGHT: Final = (
    "r right rgt rechts droit droite derecho derecha der direito direita destro destra dx 右 みぎ"
)
_SIDES: Final = MappingProxyType(
    {
        **dict.fromkeys(_LEFT.split(), "L"),
        **dict.fromkeys(_RIGHT.split(), "R"),
    }
)
_SIDE_PREFIX: Final = re.compile(r"^(left|right|左|右|ひだり|みぎ|l|r)(?=.)")
_SIDE_SUFFIX: Final = re.compile(r"(?<=.)(left|right|左|右|ひだり|みぎ)$")
_WORD: Final = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|[^\W\d_a-zA-Z]+|\d+")
_VERTEBRA: Final = re.compile(r"^[TL]\d{1,2}$")
_RUN_TOGETHER: Final = re.compile(r"^[LR][UF]$")
"""Side and first letter of what follows: "LUArm", "RFArm"."""
_NAMESPACE: Final = re.compile(r"^.*[:|](?=.)")

_COPY_WEIGHTS: Final = MappingProxyType({"def": 0.9, "org": 0.8})
"""Copies that follow the bones an artist moves, in rigs that have both."""

_REGIONS: Final = frozenset({"arm", "leg", "head", "spine", "body", "root"})
"""Words that may stand before others to say where in the body they are: "arm left elbow"."""

_BESIDE_A_SIDE: Final = MappingProxyType(
    {"larm": "lowerarm", "lleg": "lowerleg", "uarm": "upperarm", "uleg": "upperleg"}
)
"""Words short for others where the side is said: "l_larm", not "larm"."""

_STRANGE_WORD: Final = 0.3
"""What is left of the weight of a name with a word that nobody knows ("head armour")."""


def _plain(text: str) -> str:
    """Without accents, which one writes or not, and in one kana."""
    apart = unicodedata.normalize("NFKD", text).translate(_ACCENTS)
    return unicodedata.normalize("NFKC", apart).translate(_HIRAGANA)


def _meanings() -> dict[str, dict[str, float]]:
    found: dict[str, dict[str, float]] = {}
    for landmark, words in _WORDS.items():
        for word in _plain(words).split():
            text, _, weight = word.partition("=")
            found.setdefault(text, {})[landmark] = float(weight or 1.0)
    return found


_MEANINGS: Final = _meanings()


@dataclass(frozen=True)
class BoneName:
    """What one name says."""

    side: str
    """"L", "R", or "" where it names none."""
    weights: Mapping[str, float]
    """How well it fits a landmark without side ("forearm"), 0…1."""
    stem: str
    """The name without its side: the same for a bone and its mirror image."""
    machinery: bool
    """Whether it names a part of the rig (a target, a twist bone), not of the body."""
    layer: str
    """"def", "org" or "": the copies of a skeleton that a rig has."""


def read_names(names: Sequence[str]) -> tuple[BoneName, ...]:
    """What each of a rig's bone names says."""
    words = [words_of(name) for name in names]
    counts = Counter(word for each in words for word in set(each))
    # What most bones have in their names is the name of the character.
    common = {
        word
        for word, count in counts.items()
        if count > 0.5 * len(names) > 2 and not _known(word) and word not in _SIDES
    }
    return tuple(_read(each, common) for each in words)


def mirrored(names: Sequence[str], name: str) -> str | None:
    """The bone called like another one but for its side, none if there is no such bone."""
    said = dict(zip(names, read_names(names), strict=True))
    own = said.get(name)
    if own is None or not own.side:
        return None
    return next(
        (
            other
            for other, each in said.items()
            if each.side and each.side != own.side and each.stem == own.stem
        ),
        None,
    )


@cache
def _known(word: str) -> bool:
    return word in _MEANINGS or word in _NO_PART


def words_of(name: str) -> tuple[str, ...]:
    """The words of a bone's name, in small letters, without a namespace; numbers are words."""
    plain = _NAMESPACE.sub("", _plain(name))
    found: list[str] = []
    for part in re.split(r"[\W_]+", plain):
        if _VERTEBRA.match(part):
            found.append("spine")
        else:
            words = _WORD.findall(part)
            split = [[*word] if _RUN_TOGETHER.match(word) else [word] for word in words]
            found += [word.lower() for each in split for word in each]
    return tuple(found)


def _read(words: tuple[str, ...], common: set[str]) -> BoneName:
    side, rest = "", list[str]()
    filling = _FILLING | common | ({"base"} if "cc" in words else set())
    layer = next((word for word in words if word in _COPY_WEIGHTS), "")
    for word in words:
        if word in _SIDES and not side:
            side = _SIDES[word]
        elif not (word.isdigit() or word in filling):
            rest.append(word)
    if side:
        rest = [_BESIDE_A_SIDE.get(word, word) for word in rest]
    else:
        side, rest = _side_within(rest)
    numbers = [word for word in words if word.isdigit()]
    machinery = any(word in _NO_PART for word in rest)
    weights = {} if machinery else _lookup(rest, side)
    return BoneName(
        side=side,
        weights=MappingProxyType(
            {part: weight * _COPY_WEIGHTS.get(layer, 1.0) for part, weight in weights.items()}
        ),
        stem=" ".join([layer, *rest, *numbers]),
        machinery=machinery,
        layer=layer,
    )


def _side_within(words: list[str]) -> tuple[str, list[str]]:
    """Side written together with a word: "rforearm", "LEFTARM", "armleft"."""
    for place, word in enumerate(words):
        if _known(word):
            continue
        for pattern in (_SIDE_PREFIX, _SIDE_SUFFIX):
            found = pattern.search(word)
            rest = pattern.sub("", word)
            # A letter may begin any word; "left" and "右" say it.
            if found and (_known(rest) or found[1] not in {"l", "r"}):
                return _SIDES[found[1]], [*words[:place], rest, *words[place + 1 :]]
    return "", words


def _lookup(words: list[str], side: str) -> dict[str, float]:
    """Meanings of the longest run of words that has one; what stands before may only say where."""
    regions = next((n for n, word in enumerate(words) if word not in _REGIONS), len(words))
    for first in range(min(regions, len(words) - 1), 0, -1):
        meanings = _MEANINGS.get("".join(words[first:]))
        if meanings and _MEANINGS.get("".join(words)) is None:
            return _of_side(meanings, side, 1.0)
    for length in range(len(words), 0, -1):
        for start in range(len(words) - length + 1):
            meanings = _MEANINGS.get("".join(words[start : start + length]))
            if meanings:
                return _of_side(meanings, side, 1.0 if length == len(words) else _STRANGE_WORD)
    return {}


def _of_side(meanings: Mapping[str, float], side: str, share: float) -> dict[str, float]:
    return {
        part: share * weight
        for part, weight in meanings.items()
        if bool(side) == (part in _SIDED_PARTS) or not side
    }


_SIDED_PARTS: Final = frozenset(_WORDS) - {"hips", "spine", "chest", "neck", "head"}
