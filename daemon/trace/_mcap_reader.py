"""Reader of MCAP files: metadata, attachments, and runs of equal-sized messages by topic.

The reader checks every claim of a file: lengths against the existing bytes, chunk sizes against
limits before decompression, checksums against the decompressed bytes.
"""

from __future__ import annotations

import io
import itertools
import stat
import struct
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import zstandard
from lz4.frame import LZ4FrameDecompressor
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode

from daemon.trace._mcap_writer import MAGIC, records_at_any_place
from daemon.trace._model import TraceError
from daemon.trace.layouts import HEADER, ByteArray, IntArray, MessageLayout
from daemon.trace.messages import KINDS
from grammars.text.file_kinds import kind_of_content

FILE_LIMIT: Final = 1 << 30
CHUNK_LIMIT: Final = 1 << 28
TOTAL_LIMIT: Final = 1 << 29
"""Largest file, chunk and sum of decompressed chunks [bytes] that a reader accepts."""

STEP_LIMIT: Final = 1 << 22
"""Most work of a reader, in steps of about two microseconds; a run leaves some thousands.

Steps are counted, not timed, so that the result does not depend on the load of the machine."""
RECORD_STEPS: Final = 4
"""Steps of a single record, and of a run of messages of equal size."""

_MESSAGE: Final = bytes([Opcode.MESSAGE])
_RECORD: Final = struct.Struct("<BQ")
_CHUNK_HEAD: Final = struct.Struct("<QQQII")
_LENGTH: Final = struct.Struct("<Q")
_INDEX_HEAD: Final = struct.Struct("<HI")
_INDEX_ENTRY: Final = np.dtype([("time", "<i8"), ("offset", "<i8")])


class DamagedTraceError(Exception):
    """Damage that ends the reading of a file; the message describes it."""


@dataclass(slots=True)
class McapContents:
    """Contents of a file: ``runs`` are rows of message records (n, size), in file order.

    Records that fit one of the ``layouts`` of topics are in ``packed``
    (:meth:`MessageLayout.pack`), others in ``runs``. ``cut`` is the reason why reading stopped
    before the end of the file, or empty. ``steps`` is the work so far.
    """

    path: Path
    layouts: Mapping[str, MessageLayout]
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    runs: dict[str, list[ByteArray]] = field(default_factory=dict)
    packed: dict[str, list[npt.NDArray[np.void]]] = field(default_factory=dict)
    cut: str = ""
    steps: int = 0

    def copy(self) -> McapContents:
        """Return a copy that can grow without changing these contents."""
        return replace(
            self,
            metadata={**self.metadata},
            runs={topic: [*rows] for topic, rows in self.runs.items()},
            packed={topic: [*rows] for topic, rows in self.packed.items()},
        )

    def add(self, topic: str, data: bytes | memoryview, offsets: IntArray, sizes: IntArray) -> None:
        """Add message records of a topic, with their ``sizes`` (n,) [bytes] and ``offsets`` (n,).

        Successive records of equal size stay together.
        """
        edges = (np.flatnonzero(np.diff(sizes)) + 1).tolist()
        self.spend(RECORD_STEPS * (len(edges) + 1))
        layout = self.layouts.get(topic)
        for first, stop in itertools.pairwise((0, *edges, len(sizes))):
            table = records_at_any_place(data, int(sizes[first]))
            rows = table[offsets[first:stop]]
            if layout is not None and layout.fits_all(rows):
                self.packed.setdefault(topic, []).append(layout.pack(rows))
            else:
                self.runs.setdefault(topic, []).append(rows)

    def spend(self, steps: int) -> None:
        """Count work; raises :class:`TraceError` if it is more than a trace can need."""
        self.steps += steps
        if self.steps > STEP_LIMIT:
            raise TraceError(
                self.path,
                "would take long to read: it holds more records than any run leaves",
                "if another tool wrote or merged it, take the trace the run left",
            )


def read_mcap(
    path: Path,
    select: Callable[[str], bool] | None = None,
    *,
    layouts: Mapping[str, MessageLayout] | None = None,
) -> McapContents:
    """Read the messages on topics that ``select`` accepts, and everything that is not a message.

    With ``layouts`` of topics the reader keeps only values, not the chunk: 2 MB instead of 26 for
    a run of the reference stack.

    Raises :class:`TraceError` if the file cannot be opened or is not an MCAP file.
    """
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise TraceError(path, "is not an ordinary file", "name the .mcap file a run left")
        if status.st_size > FILE_LIMIT:
            raise TraceError(path, f"the file is larger than {FILE_LIMIT >> 20} MiB")
        data = path.read_bytes()
    except OSError as error:
        raise TraceError(path, f"cannot be read: {error.strerror}") from None
    if not data.startswith(MAGIC):
        kind = kind_of_content(data)
        about = f"is {kind.title}" if kind else "is not an MCAP file" if data else "is empty"
        hint = "traces are the .mcap files a run leaves; run it again to get one"
        raise TraceError(path, about, hint)
    walk = _McapWalk(McapContents(path, layouts or {}), data, select)
    try:
        walk.run()
    except DamagedTraceError as error:
        walk.recording.cut = f"{error} (at byte {walk.at} of {len(data)})"
    return walk.recording


class _McapWalk:
    """Pass over the records of a file."""

    def __init__(
        self, recording: McapContents, data: bytes, select: Callable[[str], bool] | None
    ) -> None:
        self.recording = recording
        self.at = len(MAGIC)
        self._data, self._select = data, select
        self._decompressor = zstandard.ZstdDecompressor()
        self._channels: dict[int, str] = {}
        self._schemas: dict[int, str] = {}
        self._total = 0

    def run(self) -> None:
        """Read to the end of the data; raises :class:`DamagedTraceError` if it is cut."""
        data = self._data
        while True:
            opcode, content = self._record(self.at)
            if opcode == Opcode.CHUNK:
                self._chunk(content)
            elif opcode == Opcode.DATA_END:
                break
            elif opcode == Opcode.MESSAGE:
                content = self._loose_messages(self.at)
            elif opcode != Opcode.MESSAGE_INDEX:
                self._rare(opcode, data[content.start : content.stop])
            self.at = content.stop
        if not data.endswith(MAGIC):
            raise DamagedTraceError("the end of the file is missing")

    def _loose_messages(self, at: int) -> slice:
        """Read successive messages outside chunks; return their place."""
        start, offsets = at, []
        while self._data[at : at + 1] == _MESSAGE:
            self.recording.spend(1)
            offsets.append(at)
            at = self._record(at)[1].stop
        if self._select is not None:
            self._messages(self._data, np.array(offsets, np.int64), self._select)
        return slice(start, at)

    def _record(self, at: int) -> tuple[int, slice]:
        if at + _RECORD.size > len(self._data):
            raise DamagedTraceError("the file is cut")
        opcode, length = _RECORD.unpack_from(self._data, at)
        start = at + _RECORD.size
        if length > len(self._data) - start:
            raise DamagedTraceError("the file is cut or damaged")
        return opcode, slice(start, start + length)

    def _rare(self, opcode: int, content: bytes) -> None:
        """Read a record that is neither chunk nor message."""
        kinds: dict[int, Any] = {
            Opcode.SCHEMA: records.Schema,
            Opcode.CHANNEL: records.Channel,
            Opcode.METADATA: records.Metadata,
            Opcode.ATTACHMENT: records.Attachment,
        }
        # Unused: statistics, indexes and records of later versions of the format.
        if opcode not in kinds:
            return
        self.recording.spend(RECORD_STEPS)
        try:
            record = kinds[opcode].read(ReadDataStream(io.BytesIO(content)))
        except (McapError, struct.error, ValueError, OverflowError) as error:
            # The mcap library trusts lengths inside of a record, up to 2**64.
            raise DamagedTraceError(f"a damaged {kinds[opcode].__name__.lower()} record") from error
        if isinstance(record, records.Schema):
            self._schemas[record.id] = record.name
        elif isinstance(record, records.Channel):
            kind = KINDS.get(record.topic)
            # Foreign topics may have any type: merged files and additions of other tools.
            schema = self._schemas.get(record.schema_id, "of no type")
            if kind is not None and schema != kind:
                raise DamagedTraceError(f"{record.topic} is {schema}, expected {kind}")
            self._channels[record.id] = record.topic
        elif isinstance(record, records.Metadata):
            self.recording.metadata[record.name] = record.metadata
        else:
            self.recording.attachments[record.name] = record.data

    def _chunk(self, content: slice) -> None:
        if self._select is not None:
            data = self._decompressed(content)
            offsets = self._message_offsets(data, self._indexed_offsets(content.stop))
            if len(offsets):
                self._messages(data, offsets, self._select)

    def _message_offsets(self, data: bytes, indexed: IntArray) -> IntArray:
        """Read the declarations in a chunk; return the offsets of its messages.

        The result is ``indexed`` (n,) if the data agrees.
        """
        at = 0
        walked: list[int] = []
        while at < len(data):
            self.recording.spend(1)
            opcode, end = _record_end(data, at)
            if opcode == Opcode.MESSAGE:
                offsets = None if walked else record_offsets(data, at, indexed)
                if offsets is not None:
                    return offsets
                # Without a complete index, read one record after the other.
                walked.append(at)
            else:
                self._rare(opcode, data[at + _RECORD.size : end])
            at = end
        return np.array(walked, np.int64)

    def _indexed_offsets(self, at: int) -> IntArray:
        """Return offsets of messages from the indexes after a chunk, which may be wrong."""
        entries = [np.empty(0, np.int64)]
        while True:
            try:
                opcode, content = self._record(at)
            except DamagedTraceError:
                # The file is cut right behind the chunk: only its index is lost.
                return entries[0]
            if opcode != Opcode.MESSAGE_INDEX:
                return np.concatenate(entries)
            start = content.start + _INDEX_HEAD.size
            if start > content.stop:
                raise DamagedTraceError("a damaged message index")
            count = (content.stop - start) // _INDEX_ENTRY.itemsize
            entries.append(np.frombuffer(self._data, _INDEX_ENTRY, count, start)["offset"])
            at = content.stop

    def _decompressed(self, content: slice) -> bytes:
        raw = memoryview(self._data)[content]
        if len(raw) < _CHUNK_HEAD.size:
            raise DamagedTraceError("a damaged chunk")
        _, _, size, crc, named = _CHUNK_HEAD.unpack_from(raw)
        start = _CHUNK_HEAD.size + named + _LENGTH.size
        if start > len(raw):
            raise DamagedTraceError("a damaged chunk")
        if _LENGTH.unpack_from(raw, start - _LENGTH.size)[0] != len(raw) - start:
            raise DamagedTraceError("a damaged chunk")
        self._total += size
        # Check before decompression: a few bytes of zstd can become gigabytes.
        if size > CHUNK_LIMIT or self._total > TOTAL_LIMIT:
            raise TraceError(
                self.recording.path,
                f"holds more than {TOTAL_LIMIT >> 20} MiB of messages, or a chunk too large",
            )
        method = bytes(raw[_CHUNK_HEAD.size : start - _LENGTH.size])
        data = decompress(raw[start:], method, size, decompressor=self._decompressor)
        if crc and zlib.crc32(data) != crc:
            raise DamagedTraceError("a chunk with a wrong checksum")
        return data

    def _messages(self, data: bytes, offsets: IntArray, select: Callable[[str], bool]) -> None:
        """Collect the messages at ``offsets`` (n,) of a chunk on topics that ``select`` accepts."""
        lengths = _numbers(data, offsets + 1, "<u8").astype(np.int64)
        if int(lengths.min()) < HEADER.size - _RECORD.size:
            raise DamagedTraceError("a message without a header")
        channels = _numbers(data, offsets + _RECORD.size, "<u2")
        for channel in np.unique(channels).tolist():
            topic = self._channels.get(channel)
            if topic is None:
                raise DamagedTraceError("a message on an unknown channel")
            if select(topic):
                mine = np.flatnonzero(channels == channel)
                self.recording.add(topic, data, offsets[mine], lengths[mine] + _RECORD.size)


def record_offsets(data: bytes, at: int, offsets: IntArray) -> IntArray | None:
    """Return sorted ``offsets`` of messages if they cover the data from ``at`` on.

    Each must be a message that ends at the begin of the next one, the last at the end of the data;
    otherwise ``None``.
    """
    offsets = np.sort(offsets)
    if not len(offsets) or offsets[0] != at or offsets[-1] > len(data) - HEADER.size:
        return None
    lengths = _numbers(data, offsets + 1, "<u8").astype(np.int64)
    ends = np.append(offsets[1:], len(data))
    opcodes = np.frombuffer(data, np.uint8)[offsets]
    whole = (opcodes == Opcode.MESSAGE).all() and (offsets + _RECORD.size + lengths == ends).all()
    return offsets if whole else None


def _record_end(data: bytes, at: int) -> tuple[int, int]:
    """Return the opcode and the end of the record at ``at`` in a chunk."""
    if at + _RECORD.size > len(data):
        raise DamagedTraceError("a damaged chunk")
    opcode, length = _RECORD.unpack_from(data, at)
    end: int = at + _RECORD.size + length
    if end > len(data):
        raise DamagedTraceError("a damaged chunk")
    return opcode, end


def _numbers(data: bytes, at: IntArray, kind: str) -> npt.NDArray[Any]:
    """Return the numbers of a type at the places ``at`` (n,) of the data."""
    size = np.dtype(kind).itemsize
    every = np.ndarray((len(data) - size + 1,), kind, data, 0, (1,))
    numbers: npt.NDArray[Any] = every[at]
    return numbers


def decompress(
    data: bytes | memoryview,
    method: bytes,
    size: int | None,
    limit: int = CHUNK_LIMIT,
    *,
    decompressor: zstandard.ZstdDecompressor | None = None,
) -> bytes:
    """Decompress exactly ``size`` bytes, or any number up to ``limit`` if it is ``None``.

    A ``decompressor`` serves many chunks. Memory stays within the allowed size. Raises
    :class:`DamagedTraceError` for damaged data or another size.
    """
    most = limit if size is None else size
    try:
        if method == b"zstd":
            # As a stream, because ``decompress`` allocates the size in the frame's header.
            claimed = zstandard.frame_content_size(data)
            own = decompressor or zstandard.ZstdDecompressor()
            with own.stream_reader(data) as reader:
                content = reader.read(1 + (min(claimed, most) if claimed >= 0 else most))
        elif method == b"lz4":
            content = LZ4FrameDecompressor().decompress(data, most + 1)
        elif method == b"":
            content = bytes(data)
        else:
            name = method[:16].decode("ascii", "replace")
            raise DamagedTraceError(f"chunks compressed by {name}: zstd, lz4 and none are read")
    except (zstandard.ZstdError, RuntimeError) as error:
        raise DamagedTraceError("a chunk that cannot be decompressed") from error
    if len(content) > most or (size is not None and len(content) != size):
        raise DamagedTraceError("a chunk of another size than it says")
    return content
