# SPDX-License-Identifier: GPL-3.0-or-later
"""Dataclasses of arrays: parts of them, and results that are kept by what they were made from."""

from __future__ import annotations

import dataclasses
import hashlib
import weakref
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from typing import Any, Final, Generic, Literal, TypeVar

import numpy as np

_Record = TypeVar("_Record")


def part_of(record: _Record, chosen: np.ndarray | slice, axis: Literal[0, -1] = -1) -> _Record:
    """The same record, a dataclass of arrays and of rows of arrays, of which only some items are
    there: those of some numbers, or of a slice.

    They are along the same axis of all its arrays; what is no array stays.
    """
    place = (..., chosen) if axis else chosen

    def part(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return value[place]
        if isinstance(value, list):
            return [part(each) for each in value]
        if isinstance(value, tuple):
            return tuple(part(each) for each in value)
        return value

    whole: Any = record
    return replace(whole, **{each.name: part(getattr(whole, each.name)) for each in fields(whole)})


# --- Results that are kept for the next time, by the content of what they were made from ----------
#
# For functions whose result depends on nothing but their arguments. The key is a hash of all of
# these, arrays included: a changed number is another key, so what is kept can be old, but not
# wrong.


_Result = TypeVar("_Result")

_PLAIN: Final = frozenset({bool, int, float, str, type(None)})

_ALL: Final[weakref.WeakSet[ContentCache[Any]]] = weakref.WeakSet()


class ContentCache(Generic[_Result]):
    """The last few results of one function; the one that was not asked for longest goes first."""

    def __init__(self, most: int = 8) -> None:
        self._most = most
        self._kept: OrderedDict[bytes, _Result] = OrderedDict()
        _ALL.add(self)

    def get(self, key: bytes, make: Callable[[], _Result]) -> _Result:
        """What was made for this key (:func:`content_key` of everything that the result depends
        on), else what is made now; if that raises, nothing is kept. It must not be changed
        afterwards.
        """
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key]
        made = make()
        self._kept[key] = made
        while len(self._kept) > self._most:
            self._kept.popitem(last=False)
        return made

    def known(self, key: bytes) -> _Result | None:
        """What was made for this key, none if nothing is kept of it."""
        return self._kept.get(key)

    def __len__(self) -> int:
        """How many results are kept."""
        return len(self._kept)

    def clear(self) -> None:
        """Keep nothing."""
        self._kept.clear()


def clear_caches() -> None:
    """Keep no result of any function: another file, another world."""
    for each in list(_ALL):
        each.clear()


def content_key(*values: Any) -> bytes:
    """A hash of values: numbers, texts, arrays, and tuples, mappings and dataclasses of them.

    A dataclass that is asked for often may keep the key of its fields as ``content``.

    Raises:
        TypeError: a value's content is not known to be all that there is to it.
    """
    digest = hashlib.blake2b(digest_size=16)
    for value in values:
        _add(digest, value)
    return digest.digest()


def _add(digest: hashlib.blake2b, value: Any) -> None:
    # Each begins with its type and its size: no two rows of values read the same.
    if isinstance(value, np.ndarray):
        if value.dtype.hasobject:
            raise TypeError("arrays of objects have no content of their own")
        digest.update(f"array {value.dtype.str} {value.shape};".encode())
        digest.update(np.ascontiguousarray(value).data if value.size else b"")
    elif value is None or isinstance(value, (bool, int, float, np.generic)):
        digest.update(f"{type(value).__name__} {value!r};".encode())
    elif isinstance(value, str):
        encoded = value.encode()
        digest.update(f"text {len(encoded)};".encode() + encoded)
    elif isinstance(value, bytes):
        digest.update(f"bytes {len(value)};".encode() + value)
    elif isinstance(value, (tuple, list)):
        if _PLAIN.issuperset(map(type, value)):
            # Its text is all there is to it, and quickly made.
            text = repr(tuple(value)).encode()
            digest.update(f"plain row {len(text)};".encode() + text)
            return
        digest.update(f"row {len(value)};".encode())
        for each in value:
            _add(digest, each)
    elif isinstance(value, Mapping):
        digest.update(f"mapping {len(value)};".encode())
        for name, each in value.items():
            _add(digest, name)
            _add(digest, each)
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        known = getattr(value, "content", None)
        if isinstance(known, bytes):
            # Its content is known from before.
            digest.update(b"content;" + known)
            return
        fields = dataclasses.fields(value)
        digest.update(f"{type(value).__qualname__} {len(fields)};".encode())
        for each in fields:
            _add(digest, getattr(value, each.name))
    else:
        raise TypeError(f"the content of a {type(value).__name__} is not known")
