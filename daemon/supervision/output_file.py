"""Output of processes: its first and last part, in a file of bounded size."""

from __future__ import annotations

import os
import struct
from pathlib import Path
from typing import Final


class OutputFile:
    """A file with the first and the last part of an output, never longer than a MiB.

    Up to ``HEAD + TAIL`` bytes it is the plain output. Beyond, the last part is a ring, and eight
    bytes at the end count all bytes printed. So it is valid at any moment, and readable after a
    SIGKILL.
    """

    HEAD: Final = 256 * 1024
    TAIL: Final = 768 * 1024 - 256
    _COUNT: Final = struct.Struct("<Q")

    def __init__(self, path: Path) -> None:
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        os.ftruncate(self._file, 0)
        self._full = False
        self._total = 0

    def write(self, data: bytes) -> None:
        """Add output; a full disk loses the rest of it, without waiting."""
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
            if self._total == self.HEAD + self.TAIL:
                self._write_count()  # from here on the last part is a ring
            count = os.pwrite(self._file, data[:room], place)
            self._total += count
            data = data[count:]
        if self._total > self.HEAD + self.TAIL:
            self._write_count()

    def _write_count(self) -> None:
        os.pwrite(self._file, self._COUNT.pack(self._total), self.HEAD + self.TAIL)

    def close(self) -> None:
        """Close the file, which stays on the disk."""
        os.close(self._file)

    @classmethod
    def read(cls, path: Path) -> bytes:
        """Return the output in such a file, with a line for the bytes left out; may be empty.

        Reads at most about a MiB, also from a longer file without the count at its end.
        """
        most = cls.HEAD + cls.TAIL
        try:
            with path.open("rb") as file:
                size = os.fstat(file.fileno()).st_size
                data = file.read(most)
                if size <= most:
                    return data
                if size == most + cls._COUNT.size:
                    (total,) = cls._COUNT.unpack(file.read(cls._COUNT.size))
                    turn = cls.HEAD + (total - cls.HEAD) % cls.TAIL
                    tail = data[turn:] + data[cls.HEAD : turn]
                else:
                    total = size
                    file.seek(size - cls.TAIL)
                    tail = file.read(cls.TAIL)
        except FileNotFoundError:
            return b""
        left_out = total - most
        words = f"\n[... {left_out} bytes left out ...]\n".encode() if left_out else b""
        return data[: cls.HEAD] + words + tail
