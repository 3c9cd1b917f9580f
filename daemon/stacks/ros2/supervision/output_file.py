"""What a stack prints: its first and its last part, in a file that never grows beyond a limit."""

from __future__ import annotations

import os
import struct
from pathlib import Path
from typing import Final


class OutputFile:
    """A file with the first and the last part of what was printed, never longer than a MiB.

    Eight bytes with the number of all bytes, then the first :data:`HEAD` of them, then a ring of
    :data:`TAIL`: valid at any moment, so that it can be read after a SIGKILL.
    """

    HEAD: Final = 256 * 1024
    TAIL: Final = 768 * 1024 - 256
    _COUNT: Final = struct.Struct("<Q")

    def __init__(self, path: Path) -> None:
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        self._full = False
        self.clear()

    def clear(self) -> None:
        """Begin again, for the next run."""
        self._total = 0
        os.ftruncate(self._file, 0)

    def write(self, data: bytes) -> None:
        """Add what was printed; what a full disk does not take is lost, and nobody waits for it."""
        if self._full:
            return
        try:
            self._write(memoryview(data))
        except OSError:
            self._full = True

    def _write(self, data: memoryview) -> None:
        while data:
            if self._total < self.HEAD:
                place, room = self._total, self.HEAD - self._total
            else:
                turn = (self._total - self.HEAD) % self.TAIL
                place, room = self.HEAD + turn, self.TAIL - turn
            written = os.pwrite(self._file, data[:room], self._COUNT.size + place)
            self._total += written
            data = data[written:]
        os.pwrite(self._file, self._COUNT.pack(self._total), 0)

    @classmethod
    def read(cls, path: Path) -> bytes:
        """Return what such a file holds, with a line that says what was left out; may be empty."""
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            return b""
        if len(data) < cls._COUNT.size:
            return b""
        (total,) = cls._COUNT.unpack_from(data)
        data = data[cls._COUNT.size :]
        if total <= cls.HEAD + cls.TAIL:
            return data[:total]
        turn = cls.HEAD + (total - cls.HEAD) % cls.TAIL
        left_out = f"\n[... {total - cls.HEAD - cls.TAIL} bytes left out ...]\n".encode()
        return data[: cls.HEAD] + left_out + data[turn:] + data[cls.HEAD : turn]
