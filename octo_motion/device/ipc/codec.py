# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixed layouts of bytes for the fields of messages; whatever is read is checked.

Little endian, no padding. A field is told how it is laid out by an annotation:
``mass: Annotated[float, F64]``. Nothing is ever evaluated, imported or unpickled.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite
from typing import Any, Final, Protocol

import numpy as np


class MessageError(ValueError):
    """The bytes are no message of ours."""


class Reader:
    """Bytes taken one after the other."""

    def __init__(self, data: bytes) -> None:
        self._data = memoryview(data)
        self._at = 0

    def take(self, count: int) -> memoryview:
        """The next bytes.

        Raises:
            MessageError: there are not so many.
        """
        end = self._at + count
        if end > len(self._data):
            raise MessageError("cut off")
        taken = self._data[self._at : end]
        self._at = end
        return taken

    def end(self) -> None:
        """Say that all is read.

        Raises:
            MessageError: something is left.
        """
        if self._at != len(self._data):
            raise MessageError("too long")


class Codec(Protocol):
    """How the value of one field stands in a message."""

    def put(self, value: Any, out: bytearray) -> None:
        """Append the value's bytes."""
        ...

    def take(self, reader: Reader) -> Any:
        """Read the value.

        Raises:
            MessageError: the bytes are no such value.
        """
        ...


@dataclass(frozen=True)
class Number:
    """A number, or a tuple of several."""

    code: str
    """As in ``struct``."""
    count: int = 1

    def layout(self) -> struct.Struct:
        """Of these numbers alone."""
        return struct.Struct(f"<{self.count}{self.code}")

    def check(self, values: tuple[Any, ...]) -> Any:
        """The field's value from its numbers.

        Raises:
            MessageError: a number is not finite, or a truth value neither 0 nor 1.
        """
        if self.code == "d" and not all(map(isfinite, values)):
            raise MessageError("a number is not finite")
        return values if self.count > 1 else values[0]

    def put(self, value: Any, out: bytearray) -> None:
        """Append the value's bytes."""
        out += self.layout().pack(*(value if self.count > 1 else (value,)))

    def take(self, reader: Reader) -> Any:
        """Read the value."""
        layout = self.layout()
        return self.check(layout.unpack(reader.take(layout.size)))


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
        data = str(value).encode()[: self.most].decode(errors="ignore").encode()
        out += struct.pack("<H", len(data)) + data

    def take(self, reader: Reader) -> str:
        """Read the text."""
        (length,) = struct.unpack("<H", reader.take(2))
        if length > self.most:
            raise MessageError("a text is too long")
        try:
            return str(reader.take(length), "utf-8")
        except UnicodeDecodeError as error:
            raise MessageError("a text is not UTF-8") from error


@dataclass(frozen=True)
class Many:
    """A tuple of values of one kind, with their count before them."""

    of: Codec
    most: int

    def put(self, value: Any, out: bytearray) -> None:
        """Append the values."""
        out += struct.pack("<H", len(value))
        for each in value:
            self.of.put(each, out)

    def take(self, reader: Reader) -> tuple[Any, ...]:
        """Read the values."""
        (count,) = struct.unpack("<H", reader.take(2))
        if count > self.most:
            raise MessageError("too many of something")
        return tuple(self.of.take(reader) for _ in range(count))


MOST_BODIES: Final = 4096


@dataclass(frozen=True)
class Table:
    """An array of float64, mostly a row for each body; its shape within a row is fixed."""

    row: tuple[int, ...] = ()
    most: int = MOST_BODIES
    """Rows."""
    endless: bool = False
    """Whether a number may be infinite: a joint that never gives way."""

    def put(self, value: Any, out: bytearray) -> None:
        """Append the array."""
        array = np.ascontiguousarray(value, dtype="<f8")
        if array.shape[1:] != self.row:
            raise MessageError(f"an array of shape {array.shape}")
        out += struct.pack("<I", len(array)) + array.tobytes()

    def take(self, reader: Reader) -> Any:
        """Read the array; it may be written to."""
        (count,) = struct.unpack("<I", reader.take(4))
        if count > self.most:
            raise MessageError("too many rows")
        width = 1
        for each in self.row:
            width *= each
        array = np.frombuffer(reader.take(8 * count * width), dtype="<f8").astype(np.float64)
        if np.isnan(array).any() or not (self.endless or np.isfinite(array).all()):
            raise MessageError("a number is not finite")
        return array.reshape((count, *self.row))


class Record:
    """Packs and reads the fields of one kind of message; at once where all sizes are fixed."""

    def __init__(self, codecs: tuple[Codec, ...]) -> None:
        self._codecs = codecs
        numbers = [each for each in codecs if isinstance(each, Number)]
        self._struct = (
            struct.Struct("<" + "".join(f"{each.count}{each.code}" for each in numbers))
            if len(numbers) == len(codecs)
            else None
        )
        self._numbers = numbers

    def pack(self, values: tuple[Any, ...]) -> bytes:
        """Bytes of a message's fields."""
        if self._struct is not None:
            flat: list[Any] = []
            for number, value in zip(self._numbers, values, strict=True):
                if number.count > 1:
                    flat.extend(value)
                else:
                    flat.append(value)
            return self._struct.pack(*flat)
        out = bytearray()
        for codec, value in zip(self._codecs, values, strict=True):
            codec.put(value, out)
        return bytes(out)

    def unpack(self, data: bytes) -> tuple[Any, ...]:
        """Values of a message's fields.

        Raises:
            MessageError: the bytes are no such message.
        """
        if self._struct is not None:
            if len(data) != self._struct.size:
                raise MessageError("of another length")
            return tuple(self._split(self._struct.unpack(data)))
        reader = Reader(data)
        values = tuple(codec.take(reader) for codec in self._codecs)
        reader.end()
        return values

    def _split(self, flat: tuple[Any, ...]) -> Iterator[Any]:
        at = 0
        for number in self._numbers:
            yield number.check(flat[at : at + number.count])
            at += number.count
