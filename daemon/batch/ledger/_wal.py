"""The write-ahead log of the ledger, read without SQLite: how much of it is sound, what is lost.

SQLite uses a WAL up to the first frame whose checksum is wrong and drops the rest without a word
(https://www.sqlite.org/fileformat2.html, section 4), however many transactions were acknowledged
behind it. The index beside it (the -shm file, https://www.sqlite.org/walformat.html) says how far
it was committed; the first who opens the ledger makes that anew, so this has to be asked before.
"""

from __future__ import annotations

import shutil
import struct
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from grammars.text.files import move_durably, replacing

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_HEADER: Final = struct.Struct(">8I")
"""Magic number, version, page size, checkpoints so far, two salts, two checksums."""
_FRAME: Final = 24
"""Bytes before each page: its number, pages of the database if this commits, salts, checksums."""
_MAGIC: Final = 0x377F0682
"""With 1 added the words of checksums are big-endian."""
_VERSION: Final = 3007000
_INDEX: Final = struct.Struct("=3IBBH8I")
"""Version, unused, changes, whether it is initialised, byte order, page size, committed frames,
pages, checksums of the last frame, salts, checksums of this; twice, for a torn one to be seen."""
_BACKFILLED: Final = 2 * _INDEX.size
"""Where the index says how many frames are in the database."""
_BLOCK: Final = 4 * 2**20
_TRIES: Final = 3
DAMAGED: Final = ".damaged-"
"""Part of the name of a damaged WAL that was put aside."""


@dataclass(frozen=True, slots=True)
class WalState:
    """A WAL of ``size`` bytes, counted in frames, each of which is a page.

    ``sound`` is how many SQLite uses, ``committed`` how many are known to have been acknowledged,
    ``checkpointed`` how many of those are in the database as well. ``transactions`` counts the
    commits between what is sound and what was acknowledged.
    """

    size: int = 0
    sound: int = 0
    committed: int = 0
    checkpointed: int = 0
    transactions: int = 0

    @property
    def damaged(self) -> bool:
        """Whether something acknowledged is not to be had from it any more."""
        return self.sound < self.committed

    @property
    def lost(self) -> int:
        """How many acknowledged transactions are neither in it nor in the database, about."""
        if not self.damaged or self.checkpointed >= self.committed:
            return 0
        return max(1, self.transactions)


@dataclass(frozen=True, slots=True)
class _WalIndex:
    salts: bytes
    committed: int
    checkpointed: int


def wal_path(ledger: Path) -> Path:
    """Path of the WAL of a ledger."""
    return ledger.with_name(f"{ledger.name}-wal")


def index_path(ledger: Path) -> Path:
    """Path of the index of the WAL of a ledger."""
    return ledger.with_name(f"{ledger.name}-shm")


def damaged_copies(ledger: Path) -> tuple[Path, ...]:
    """The damaged WALs that were put aside, the oldest first."""
    return tuple(sorted(ledger.parent.glob(f"{ledger.name}-wal{DAMAGED}*")))


def read_wal(ledger: Path) -> WalState:
    """Examine the WAL of a ledger, which a daemon may be writing; raises ``OSError``."""
    state = WalState()
    for _ in range(_TRIES):
        index = _read_index(index_path(ledger))
        try:
            state = _examine(wal_path(ledger), index)
        except (FileNotFoundError, NotADirectoryError):
            state = _without_file(index)
        # A daemon that begins the WAL anew meanwhile makes sound frames look wrong.
        if not state.damaged or _read_index(index_path(ledger)) == index:
            return state
    return state


def set_damaged_aside(ledger: Path, now: float) -> tuple[WalState, Path | None]:
    """Keep a copy of a damaged WAL before SQLite drops what is behind the damage.

    To be called before anybody opens the ledger. Returns what was found, and where the copy is;
    ``now`` [s since the epoch] is part of its name. Raises ``OSError``.
    """
    state, wal = read_wal(ledger), wal_path(ledger)
    if not state.damaged or not wal.exists():
        return state, None
    stamp = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(now))
    copy = wal.with_name(f"{wal.name}{DAMAGED}{stamp}")
    if state.checkpointed > state.sound:
        # The database is newer than what is sound: used, old pages would cover new ones.
        move_durably(wal, copy)
        index_path(ledger).unlink(missing_ok=True)
    else:
        with replacing(copy, mode=0o600) as temporary:
            shutil.copyfile(wal, temporary)
    return state, copy


def _without_file(index: _WalIndex | None) -> WalState:
    if index is None:
        return WalState()
    return WalState(committed=index.committed, checkpointed=index.checkpointed)


def _read_index(path: Path) -> _WalIndex | None:
    """What the index says, ``None`` when it says nothing that can be relied on."""
    try:
        # One that was not written since the machine started may be of any age after a power cut.
        if path.stat().st_mtime < time.time() - time.clock_gettime(time.CLOCK_BOOTTIME):
            return None
        with path.open("rb") as file:
            data = file.read(_BACKFILLED + 4)
    except OSError:
        return None
    if len(data) < _BACKFILLED + 4 or data[: _INDEX.size] != data[_INDEX.size : _BACKFILLED]:
        return None
    fields = _INDEX.unpack_from(data)
    words = struct.unpack(f"={_INDEX.size // 4}I", data[: _INDEX.size])
    if fields[0] != _VERSION or not fields[3] or _checksum(words[:-2], (0, 0)) != fields[-2:]:
        return None
    (checkpointed,) = struct.unpack_from("=I", data, _BACKFILLED)
    return _WalIndex(data[32:40], fields[6], checkpointed)


def _checksum(words: tuple[int, ...], start: tuple[int, int]) -> tuple[int, int]:
    one, two = start
    for first, second in zip(words[::2], words[1::2], strict=True):
        one = (one + first + two) & 0xFFFFFFFF
        two = (two + second + one) & 0xFFFFFFFF
    return one, two


def _examine(path: Path, index: _WalIndex | None) -> WalState:
    with path.open("rb") as file:
        head = file.read(_HEADER.size)
        if len(head) < _HEADER.size:
            return WalState(path.stat().st_size, *_from_index(index))
        order, page, chain = _read_header(head)
        if not page:
            # SQLite ignores all of it. One that a power cut left without a frame has none to lose.
            behind = path.stat().st_size > _HEADER.size + _FRAME
            committed, checkpointed = (int(behind), 0) if index is None else _from_index(index)[1:]
            return WalState(path.stat().st_size, 0, committed, checkpointed)
        salts = head[16:24]
        if index is not None and index.salts != salts:
            index = None  # of another WAL: nothing was committed to this one, or it is foreign
        scan = _Scan(index.committed if index else None)
        previous = chain
        while data := file.read(_BLOCK // (page + _FRAME) * (page + _FRAME)):
            previous = scan.add(_Frames(data, page, order, salts, previous))
    return scan.state(path.stat().st_size, index)


def _from_index(index: _WalIndex | None) -> tuple[int, int, int]:
    return (0, index.committed, index.checkpointed) if index else (0, 0, 0)


def _read_header(head: bytes) -> tuple[str, int, tuple[int, int]]:
    """Byte order of checksums, page size (0 when the header is not sound), first checksum."""
    magic, version, page, *_, one, two = _HEADER.unpack(head)
    order = ">" if magic & 1 else "<"
    sound = magic & ~1 == _MAGIC and version == _VERSION
    sound &= 512 <= page <= 65536 and page & (page - 1) == 0
    sound &= _checksum(struct.unpack(f"{order}6I", head[:24]), (0, 0)) == (one, two)
    return order, page if sound else 0, (one, two)


class _Frames:
    """Whole frames as they follow each other: which belong, which are sound, which commit."""

    def __init__(
        self, data: bytes, page: int, order: str, salts: bytes, previous: tuple[int, int]
    ) -> None:
        import numpy as np  # loaded where a WAL is read: completion opens ledgers at every TAB

        count = len(data) // (page + _FRAME)
        size = count * (page + _FRAME)
        frames = np.frombuffer(data, np.uint8, size).reshape(count, page + _FRAME)
        heads = np.ascontiguousarray(frames[:, :_FRAME]).view(">u4").astype(np.uint32)
        wanted = np.frombuffer(salts, ">u4").astype(np.uint32)
        self.ours = (heads[:, 2:4] == wanted).all(axis=1)
        self.commits = self.ours & (heads[:, 1] != 0)
        stored = heads[:, 4:6]
        before = np.vstack([np.array([previous], np.uint32), stored[:-1]])
        words = np.concatenate([frames[:, :8], frames[:, _FRAME:]], axis=1).view(f"{order}u4")
        found = _frame_checksums(words.astype(np.uint32), before)
        self.sound = self.ours & (heads[:, 0] != 0) & (found == stored).all(axis=1)
        self.last = (int(stored[-1, 0]), int(stored[-1, 1])) if count else previous


def _frame_checksums(words: NDArray[np.uint32], before: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Checksums of frames, a row each, from those of the frames before; modulo 2**32.

    A step is linear, s0 += x0 + s1 and s1 += x1 + s0: each word has a weight by its place.
    """
    import numpy as np

    weights, power = _weights(words.shape[1] // 2)
    columns = []
    for row in range(2):
        total = (words[:, 0::2] * weights[row, 0]).sum(axis=1, dtype=np.uint32)
        total += (words[:, 1::2] * weights[row, 1]).sum(axis=1, dtype=np.uint32)
        total += (before * power[row]).sum(axis=1, dtype=np.uint32)
        columns.append(total)
    return np.stack(columns, axis=1)


@cache
def _weights(steps: int) -> tuple[Any, Any]:
    """Weights of both words of each step in both sums, and of the sums before."""
    import numpy as np

    mask = 0xFFFFFFFF
    power = (1, 0, 0, 1)
    found: list[tuple[int, int, int, int]] = []
    for _ in range(steps):
        a, b, c, d = power
        # power times [[1, 0], [1, 1]]: how the words of this step enter it
        found.append(((a + b) & mask, b, (c + d) & mask, d))
        # power times [[1, 1], [1, 2]]: one step earlier
        power = ((a + b) & mask, (a + 2 * b) & mask, (c + d) & mask, (c + 2 * d) & mask)
    table = np.array(found[::-1], np.uint32).T.reshape(2, 2, steps)
    return np.ascontiguousarray(table), np.array(power, np.uint32).reshape(2, 2)


class _Scan:
    """Goes through the frames of a WAL block by block."""

    def __init__(self, committed: int | None) -> None:
        self._known = committed
        self._count = 0
        self._broken = False
        self._sound = 0
        self._commits: list[int] = []
        self._last_ours = 0

    def add(self, frames: _Frames) -> tuple[int, int]:
        """Take the next frames; returns the checksum that the following one goes on from."""
        good = len(frames.sound)
        if not self._broken:
            wrong = (~frames.sound).nonzero()[0]
            if len(wrong):
                self._broken, good = True, int(wrong[0])
            ended = frames.commits[:good].nonzero()[0]
            if len(ended):
                self._sound = self._count + int(ended[-1]) + 1
        else:
            good = 0
        behind = frames.commits.nonzero()[0]
        self._commits += [self._count + int(at) + 1 for at in behind if at >= good]
        ours = frames.ours.nonzero()[0]
        if len(ours):
            self._last_ours = self._count + int(ours[-1]) + 1
        self._count += len(frames.sound)
        return frames.last

    def state(self, size: int, index: _WalIndex | None) -> WalState:
        """What the frames come to."""
        if index is not None:
            committed, checkpointed = index.committed, index.checkpointed
        else:
            # A commit is on the disk before a frame behind it is written. The last one may be torn
            # by a power cut: that was never acknowledged.
            certain = [at for at in self._commits if at < self._last_ours]
            committed, checkpointed = max([self._sound, *certain]), 0
        behind = sum(1 for at in self._commits if self._sound < at <= committed)
        return WalState(size, self._sound, committed, checkpointed, behind)
