# SPDX-License-Identifier: GPL-3.0-or-later
"""What goes through the pipe between a process and one that it started: arrays and dataclasses.

Each message is pickled, after its length. Both ends are programs of ours, and nobody else has the
pipe; all the same nothing is unpickled but what numpy and this package's core have. The package has
another name within Blender, so names of modules are those of whoever reads.
"""

from __future__ import annotations

import io
import pickle
import struct
from typing import Any, BinaryIO, Final

OURS: Final = __name__.removesuffix(".core.processes.wire")
"""What the package is called here."""
_LENGTH: Final = struct.Struct("<Q")
_BUILTINS: Final = frozenset({"slice", "range", "complex", "set", "frozenset", "bytearray"})


def send(pipe: BinaryIO, message: object) -> None:
    """Write one message.

    Raises:
        OSError: nobody reads any more.
    """
    data = pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
    pipe.write(_LENGTH.pack(len(data)))
    pipe.write(data)
    pipe.flush()


def receive(pipe: BinaryIO, theirs: str) -> Any:
    """The next message of one who calls the package by that name.

    Raises:
        EOFError: there is none: the other one is gone.
        pickle.UnpicklingError: it is none of ours.
    """
    (length,) = _LENGTH.unpack(_read(pipe, _LENGTH.size))
    return _Reader(_read(pipe, length), theirs).load()


def _read(pipe: BinaryIO, count: int) -> bytes:
    data = pipe.read(count)
    if len(data) < count:
        raise EOFError
    return data


class _Reader(pickle.Unpickler):  # noqa: S301 - both ends are ours, and see find_class
    """Knows numpy, and the core of this package by the sender's name for it."""

    def __init__(self, data: bytes, theirs: str) -> None:
        super().__init__(io.BytesIO(data))
        self._core = f"{theirs}.core."

    def find_class(self, module_name: str, global_name: str, /) -> Any:
        if module_name.startswith(self._core):
            module_name = f"{OURS}.core.{module_name.removeprefix(self._core)}"
        elif not (
            module_name.split(".")[0] == "numpy"
            or (module_name == "builtins" and global_name in _BUILTINS)
        ):
            raise pickle.UnpicklingError(f"{module_name}.{global_name} does not belong here")
        return super().find_class(module_name, global_name)
