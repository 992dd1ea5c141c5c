# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixed layouts of bytes for the fields of messages; whatever is read is checked.

Little endian, no padding. An annotation gives a field its layout:
``mass: Annotated[float, F64]``. Nothing is ever evaluated, imported or unpickled.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass, fields
from functools import cached_property
from io import BytesIO
from typing import Any, Final, get_args, get_type_hints

import numpy as np

from ..core.phrases import packed, unpacked


class MessageError(ValueError):
    """The bytes are no message of ours."""


def _take(data: BytesIO, count: int) -> bytes:
    taken = data.read(count)
    if len(taken) < count:
        raise MessageError("cut off")
    return taken


@dataclass(frozen=True)
class Number:
    """A number, or a tuple of several."""

    code: str
    """As in ``struct``."""
    count: int = 1

    @cached_property
    def _layout(self) -> struct.Struct:
        return struct.Struct(f"<{self.count}{self.code}")

    def put(self, value: Any, out: bytearray) -> None:
        out += self._layout.pack(*(value if self.count > 1 else (value,)))

    def take(self, data: BytesIO) -> Any:
        values = self._layout.unpack(_take(data, self._layout.size))
        if self.code == "d" and not all(map(math.isfinite, values)):
            raise MessageError("a number is not finite")
        return values if self.count > 1 else values[0]


U8: Final = Number("B")
U16: Final = Number("H")
U32: Final = Number("I")
I32: Final = Number("i")
F64: Final = Number("d")
FLAG: Final = Number("?")
VECTOR: Final = Number("d", 3)
QUATERNION: Final = Number("d", 4)
SIX: Final = Number("d", 6)


@dataclass(frozen=True)
class Text:
    """UTF-8 with its length before it."""

    most: int = 400
    """Bytes."""

    def put(self, value: Any, out: bytearray) -> None:
        """Append the text, cut to what fits."""
        text = str(value).encode()[: self.most].decode(errors="ignore").encode()
        out += struct.pack("<H", len(text)) + text

    def take(self, data: BytesIO) -> str:
        (length,) = struct.unpack("<H", _take(data, 2))
        if length > self.most:
            raise MessageError("a text is too long")
        try:
            return str(_take(data, length), "utf-8")
        except UnicodeDecodeError as error:
            raise MessageError("a text is not UTF-8") from error


@dataclass(frozen=True)
class Said(Text):
    """A text for people, which may be a phrase: what it is made of."""

    most: int = 4000

    def put(self, value: Any, out: bytearray) -> None:
        made = packed(value)
        # Too long to go whole: the beginning of what it says.
        super().put(made if len(made.encode()) <= self.most else packed(str(value)[:400]), out)

    def take(self, data: BytesIO) -> str:
        packed_text = super().take(data)
        try:
            return unpacked(packed_text)
        except (ValueError, RecursionError) as error:
            raise MessageError("a text for people is damaged") from error


@dataclass(frozen=True)
class Many:
    """A tuple of values of one kind, with their count before them."""

    of: Codec
    most: int

    def put(self, value: Any, out: bytearray) -> None:
        out += struct.pack("<H", len(value))
        for each in value:
            self.of.put(each, out)

    def take(self, data: BytesIO) -> tuple[Any, ...]:
        (count,) = struct.unpack("<H", _take(data, 2))
        if count > self.most:
            raise MessageError("too many of something")
        return tuple(self.of.take(data) for _ in range(count))


@dataclass(frozen=True)
class Table:
    """An array of float64, mostly a row for each body; its shape within a row is fixed."""

    row: tuple[int, ...] = ()
    most: int = 4096
    """Rows."""
    endless: bool = False
    """Whether a number may be infinite: a joint that never gives way."""

    def put(self, value: Any, out: bytearray) -> None:
        array = np.ascontiguousarray(value, dtype="<f8")
        if array.shape[1:] != self.row:
            raise MessageError(f"an array of shape {array.shape}")
        out += struct.pack("<I", len(array)) + array.tobytes()

    def take(self, data: BytesIO) -> Any:
        """Read the array; it may be written to."""
        (count,) = struct.unpack("<I", _take(data, 4))
        if count > self.most:
            raise MessageError("too many rows")
        size = 8 * count * math.prod(self.row)
        array = np.frombuffer(_take(data, size), dtype="<f8").astype(np.float64)
        if np.isnan(array).any() or not (self.endless or np.isfinite(array).all()):
            raise MessageError("a number is not finite")
        return array.reshape((count, *self.row))


Codec = Number | Text | Many | Table
"""How the value of one field stands in a message."""


class Record:
    """Packs and reads the fields of one kind of message.

    Raises:
        MessageError: the bytes are no such message.
    """

    def __init__(self, kind: type) -> None:
        hints = get_type_hints(kind, include_extras=True)
        self.codecs: dict[str, Codec] = {
            each.name: get_args(hints[each.name])[1] for each in fields(kind)
        }
        """By name of the field."""

    def pack(self, message: object) -> bytes:
        out = bytearray()
        for name, codec in self.codecs.items():
            codec.put(getattr(message, name), out)
        return bytes(out)

    def unpack(self, data: bytes) -> tuple[Any, ...]:
        left = BytesIO(data)
        values = tuple(codec.take(left) for codec in self.codecs.values())
        if left.read(1):
            raise MessageError("too long")
        return values
