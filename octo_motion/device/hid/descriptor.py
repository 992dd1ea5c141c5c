# SPDX-License-Identifier: GPL-3.0-or-later
"""HID report descriptors: what each bit of a report means, as the device itself states it.

Source: USB Device Class Definition for Human Interface Devices 1.11, section 6.2.2. Read with the
suspicion due to a device: every count is bounded, and what makes no sense raises.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Final

_MOST_BYTES: Final = 4096
_MOST_FIELDS: Final = 4096
_MOST_REPORT_BITS: Final = 8 * 4096
_MOST_DEPTH: Final = 64
_WIDEST_FIELD: Final = 64


class DescriptorError(ValueError):
    """The bytes are no report descriptor."""


class ReportField(IntEnum):
    """Which way a report goes; the values are the descriptor's own tags."""

    INPUT = 0x8
    OUTPUT = 0x9
    FEATURE = 0xB


@dataclass(frozen=True)
class Field:
    """One number within a report."""

    way: ReportField
    report: int
    """Report number, 0 where the device does not number its reports."""
    page: int
    usage: int
    bit: int
    """Where it starts, counted from the byte after the report's number."""
    bits: int
    least: int
    """Logical minimum; below 0 makes the number a signed one."""
    most: int

    def value(self, payload: bytes) -> int | None:
        """The number in a report without its report number; None where the report is too short."""
        end = self.bit + self.bits
        if end > 8 * len(payload):
            return None
        first = self.bit >> 3
        raw = int.from_bytes(payload[first : (end + 7) >> 3], "little") >> (self.bit & 7)
        raw &= (1 << self.bits) - 1
        if self.least < 0 and raw >> (self.bits - 1):
            raw -= 1 << self.bits
        return raw


@dataclass(frozen=True)
class ReportLayout:
    """All that a descriptor says of a device's reports."""

    fields: tuple[Field, ...]
    numbered: bool
    """Whether each report starts with its number."""


_GLOBAL: Final = {0x0: "page", 0x1: "least", 0x2: "most", 0x7: "bits", 0x8: "report", 0x9: "count"}
_WITHOUT_EFFECT: Final = (0x3, 0x4, 0x5, 0x6)
"""Physical range and unit: known for the devices that matter here."""


@dataclass(frozen=True)
class _Global:
    page: int = 0
    least: int = 0
    most: int = 0
    bits: int = 0
    count: int = 0
    report: int = 0


@dataclass
class _Local:
    usages: list[int] = field(default_factory=list[int])
    first: int | None = None
    last: int | None = None

    def usage(self, index: int) -> int:
        """The index-th usage; the last one named goes on, as the standard says (6.2.2.8)."""
        if self.usages:
            return self.usages[min(index, len(self.usages) - 1)]
        if self.first is not None:
            return min(self.first + index, self.first if self.last is None else self.last)
        return 0


@dataclass
class _Parser:
    state: _Global = field(default_factory=_Global)
    local: _Local = field(default_factory=_Local)
    stack: list[_Global] = field(default_factory=list[_Global])
    depth: int = 0
    fields: list[Field] = field(default_factory=list[Field])
    lengths: dict[tuple[ReportField, int], int] = field(
        default_factory=dict[tuple[ReportField, int], int]
    )
    numbered: bool = False

    def main(self, tag: int, value: int) -> None:
        if tag in (ReportField.INPUT, ReportField.OUTPUT, ReportField.FEATURE):
            self.add_fields(ReportField(tag), value)
        elif tag == 0xA:
            self.depth += 1
            if self.depth > _MOST_DEPTH:
                raise DescriptorError("collections are nested too deep")
        elif tag == 0xC:
            self.depth -= 1
            if self.depth < 0:
                raise DescriptorError("a collection ends that never began")
        else:
            raise DescriptorError(f"main item {tag:#x} is unknown")
        self.local = _Local()

    def add_fields(self, way: ReportField, flags: int) -> None:
        state = self.state
        start = self.lengths.get((way, state.report), 0)
        end = start + state.bits * state.count
        if end > _MOST_REPORT_BITS:
            raise DescriptorError("a report is too long")
        self.lengths[way, state.report] = end
        if flags & 1 or not flags & 2:
            return  # padding, or an array of usages: no number of its own
        if not 0 < state.bits <= _WIDEST_FIELD:
            raise DescriptorError(f"a field of {state.bits} bits")
        if len(self.fields) + state.count > _MOST_FIELDS:
            raise DescriptorError("too many fields")
        for index in range(state.count):
            page, usage = _full_usage(state.page, self.local.usage(index))
            self.fields.append(
                Field(
                    *(way, state.report, page, usage, start + index * state.bits, state.bits),
                    *(state.least, state.most),
                )
            )

    def global_item(self, tag: int, value: int, signed: int) -> None:
        if tag == 0xA:
            if len(self.stack) >= _MOST_DEPTH:
                raise DescriptorError("too much is pushed")
            self.stack.append(self.state)
        elif tag == 0xB:
            if not self.stack:
                raise DescriptorError("popped without a push")
            self.state = self.stack.pop()
        elif tag in _GLOBAL:
            name = _GLOBAL[tag]
            if name == "page":
                value &= 0xFFFF
            # Many write 255 in one byte: a maximum is below 0 only if its minimum is.
            if name == "least" or (name == "most" and self.state.least < 0):
                value = signed
            if name == "report":
                if not 0 < value <= 0xFF:
                    raise DescriptorError(f"report number {value}")
                self.numbered = True
            self.state = replace(self.state, **{name: value})
        elif tag not in _WITHOUT_EFFECT:
            raise DescriptorError(f"global item {tag:#x} is unknown")

    def local_item(self, tag: int, value: int, size: int) -> None:
        usage = value if size == 4 else (self.state.page << 16) | value
        if tag == 0x0:
            if len(self.local.usages) >= _MOST_FIELDS:
                raise DescriptorError("too many usages")
            self.local.usages.append(usage)
        elif tag == 0x1:
            self.local.first = usage
        elif tag == 0x2:
            self.local.last = usage


def _full_usage(page: int, usage: int) -> tuple[int, int]:
    return (usage >> 16 or page, usage & 0xFFFF)


def parse_descriptor(descriptor: bytes) -> ReportLayout:
    """The fields of a report descriptor.

    Raises:
        DescriptorError: it is cut off, out of bounds or contradicts itself.
    """
    if len(descriptor) > _MOST_BYTES:
        raise DescriptorError("longer than any descriptor")
    parser = _Parser()
    at = 0
    while at < len(descriptor):
        prefix = descriptor[at]
        if prefix == 0xFE:  # a long item: none is defined, all are to be skipped
            if at + 1 >= len(descriptor):
                raise DescriptorError("cut off")
            at += 3 + descriptor[at + 1]
            continue
        size = (0, 1, 2, 4)[prefix & 3]
        data = descriptor[at + 1 : at + 1 + size]
        if len(data) < size:
            raise DescriptorError("cut off")
        at += 1 + size
        value = int.from_bytes(data, "little")
        match (prefix >> 2) & 3:
            case 0:
                parser.main(prefix >> 4, value)
            case 1:
                signed = int.from_bytes(data, "little", signed=True)
                parser.global_item(prefix >> 4, value, signed)
            case 2:
                parser.local_item(prefix >> 4, value, size)
            case _:
                raise DescriptorError("an item of the reserved type")
    if parser.depth:
        raise DescriptorError("a collection never ends")
    return ReportLayout(tuple(parser.fields), parser.numbered)


# --- Writing one ---------------------------------------------------------------------------------


def item(kind: str, value: int = 0) -> bytes:
    """One short item, as few bytes as its value needs.

    ``kind`` is the standard's own name in lower case with underscores, for example ``usage_page``.
    """
    prefix, signed = _ITEMS[kind]
    if kind == "end_collection":
        return bytes([prefix])
    for code, size in ((1, 1), (2, 2), (3, 4)):
        with suppress(OverflowError):
            return bytes([prefix | code]) + value.to_bytes(size, "little", signed=signed)
    raise DescriptorError(f"{value} does not fit into an item")


_ITEMS: Final = {
    "input": (0x80, False),
    "output": (0x90, False),
    "feature": (0xB0, False),
    "collection": (0xA0, False),
    "end_collection": (0xC0, False),
    "usage_page": (0x04, False),
    "logical_minimum": (0x14, True),
    "logical_maximum": (0x24, True),
    "report_size": (0x74, False),
    "report_id": (0x84, False),
    "report_count": (0x94, False),
    "usage": (0x08, False),
}
