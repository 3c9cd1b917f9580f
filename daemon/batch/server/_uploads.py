"""Uploads in parts: traces from workers on other machines, files of systems under test.

A part of a trace lies under the run, the lease and the digest it is sent for, so that no sender touches what another one sends. It gets a name of a trace only when all of it is there, verified, and the ledger takes the result. Files are kept by digest, and given to workers.
"""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from daemon.batch.errors import Refused, Unavailable
from daemon.batch.ledger import LedgerReader, LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.batch.server._runtime import EventLog
from daemon.batch.stores import (
    accept_part,
    append_part,
    decode_chunk,
    encode_chunk,
    file_size,
    make_folder,
    matches_digest,
    read_part,
)
from daemon.model.ids import is_digest, is_run_id
from daemon.model.messages import (
    Completion,
    DownloadChunk,
    FileDownloadRequest,
    FileUploadChunk,
    LedgerAnswer,
    TraceUploadChunk,
    UploadProgress,
)
from grammars.text.files import move_durably

_MOST_UPLOADS: Final = 1024
"""Uploads at a time, finished ones whose result has not come included."""
_STALE: Final = 3600.0
"""Seconds after which an upload that nobody goes on with is given up."""
_SWEEP: Final = 60.0


@dataclass(slots=True)
class _PartialTrace:
    part: Path
    whole: Path
    chunk: TraceUploadChunk

    @property
    def offset(self) -> int:
        """How many bytes there are."""
        return file_size(self.part)


@dataclass(slots=True)
class TraceUploads:
    """Takes chunks, in one thread, and hands whole traces over, in the ledger's."""

    places: StatePaths
    journal: EventLog
    _begun: dict[str, float] = field(default_factory=dict)
    _sweep_at: float = 0.0

    def add_chunk(self, reader: LedgerReader, chunk: TraceUploadChunk) -> UploadProgress:
        """Add a chunk to its upload; the answer says where to go on.

        Refuses what comes under no lease, or a stale one; raises :class:`Unavailable` while there is
        no room.
        """
        if not is_run_id(chunk.run) or not is_digest(chunk.sha256):
            raise Refused(f"{chunk.run!r} is not the id of a run")
        self._sweep()
        wanted = reader.expected_upload(chunk.run, chunk.token)
        upload = self._upload(chunk)
        there = self.places.trace(wanted.name)
        if not wanted.wanted or upload.whole.exists():
            return UploadProgress(chunk.size, complete=True)
        if not chunk.data and matches_digest(there, chunk.size, chunk.sha256):
            return UploadProgress(chunk.size, complete=True)
        problem = self._add(upload) if chunk.data else ""
        if not problem and upload.offset == chunk.size:
            return self._finish(upload)
        return UploadProgress(upload.offset, complete=False, problem=problem)

    def _upload(self, chunk: TraceUploadChunk) -> _PartialTrace:
        name = f"{chunk.run}.{chunk.token}.{chunk.sha256}"
        folder = self.places.incoming
        return _PartialTrace(folder / f"{name}.part", folder / f"{name}.mcap", chunk)

    def _add(self, upload: _PartialTrace) -> str:
        chunk = upload.chunk
        if chunk.offset != upload.offset:
            return f"the chunk begins at {chunk.offset}, expected is {upload.offset}"
        try:
            data = decode_chunk(chunk.data, chunk.digest)
        except ValueError as error:
            return str(error)
        if chunk.offset + len(data) > chunk.size:
            raise Refused(f"{chunk.run}: there are more bytes than the {chunk.size} announced")
        if chunk.offset == 0:
            self._make_room(chunk)
        if shortage := self.places.disk_shortage():
            raise Unavailable(shortage)
        try:
            append_part(upload.part, chunk.offset, data)
        except OSError as error:
            raise Unavailable(f"the trace of {chunk.run} cannot be written: {error}") from error
        return ""

    def _make_room(self, chunk: TraceUploadChunk) -> None:
        """Look whether another upload can begin; what was sent of this run before goes."""
        for path in self.places.incoming.glob(f"{chunk.run}.*"):
            path.unlink(missing_ok=True)
        if sum(1 for _ in self.places.incoming.iterdir()) >= _MOST_UPLOADS:
            raise Unavailable(
                f"{_MOST_UPLOADS} traces are on their way already: this one has to wait"
            )
        if self.places.disk().free < chunk.size:
            raise Unavailable(f"no room for the {chunk.size} bytes of the trace of {chunk.run}")
        self._begun[chunk.run] = time.monotonic()

    def _finish(self, upload: _PartialTrace) -> UploadProgress:
        chunk = upload.chunk
        if not accept_part(upload.part, upload.whole, chunk.sha256):
            self.journal.write("trace damaged", run=chunk.run, worker=chunk.worker)
            return UploadProgress(
                0, complete=False, problem="the whole has another digest: begin again"
            )
        begun = self._begun.pop(chunk.run, None)
        took = None if begun is None else round(time.monotonic() - begun, 3)
        self.journal.write(
            "trace received", run=chunk.run, worker=chunk.worker, bytes=chunk.size, seconds=took
        )
        return UploadProgress(chunk.size, complete=True)

    def is_missing(self, book: LedgerWriter, completion: Completion) -> bool:
        """Whether a result would be recorded whose trace is not here (and in no store)."""
        if completion.location or not book.awaits_result(completion.run):
            return False
        name, _ = book.trace_location(completion.run)
        there = self.places.trace(name)
        if not completion.uploaded:
            return not there.is_file()
        if self._whole(completion).exists():
            return False
        return not matches_digest(
            there, completion.result.trace.size, completion.result.trace.sha256
        )

    def settle_result(
        self, book: LedgerWriter, completion: Completion, answer: LedgerAnswer
    ) -> None:
        """Do with a trace what became of its result: give it its name, or drop it.

        Before the ledger commits: what it then says is true, also when this is the end.
        """
        name, location = book.trace_location(completion.run)
        there = self.places.trace(name)
        if (
            answer is LedgerAnswer.KNOWN
            and not location
            and not there.exists()
            and completion.location
        ):
            book.set_trace_location(completion.run, completion.location)
        if not completion.uploaded:
            return
        whole = self._whole(completion)
        # A repetition of a run whose trace was removed brings it back.
        lost = answer is LedgerAnswer.KNOWN and not location and not there.exists()
        if whole.exists() and (answer is LedgerAnswer.RECORDED or lost):
            make_folder(there.parent)
            move_durably(whole, there)
        for path in self.places.incoming.glob(f"{completion.run}.{completion.token}.*"):
            path.unlink(missing_ok=True)

    def _whole(self, completion: Completion) -> Path:
        sha256 = completion.result.trace.sha256
        if not is_digest(sha256):
            raise Refused(f"{sha256[:70]!r} is not the digest of a trace")
        return self.places.incoming / f"{completion.run}.{completion.token}.{sha256}.mcap"

    def _sweep(self) -> None:
        """Remove uploads that nobody has gone on with for long."""
        now = time.monotonic()
        if now < self._sweep_at:
            return
        self._sweep_at = now + _SWEEP
        for path in self.places.incoming.iterdir():
            with suppress(FileNotFoundError):
                idle = time.time() - path.stat().st_mtime
                # A clock that was set back must not keep anything for ever.
                if abs(idle) > _STALE:
                    path.unlink()
                    self.journal.write("upload given up", name=path.name)


_MOST_FILES: Final = 4096
"""Files kept, those under way included."""


@dataclass(frozen=True, slots=True)
class FileUploads:
    """The files there are; used in one thread."""

    places: StatePaths
    journal: EventLog

    def add_chunk(self, _: LedgerReader, keep: FileUploadChunk) -> UploadProgress:
        """Add a part to a file, whoever sends it; the answer says where to go on.

        Raises :class:`Unavailable` while there is no room.
        """
        whole = self.places.files / keep.sha256
        if whole.exists():
            return UploadProgress(keep.size, complete=True)
        part = self.places.files / f".{keep.sha256}.part"
        problem = self._add(part, keep) if keep.data else ""
        if not problem and file_size(part) == keep.size:
            return self._finish(part, whole, keep)
        return UploadProgress(file_size(part), complete=False, problem=problem)

    def _add(self, part: Path, keep: FileUploadChunk) -> str:
        if keep.offset != file_size(part):
            return f"the part begins at {keep.offset}, expected is {file_size(part)}"
        try:
            data = decode_chunk(keep.data, keep.digest)
        except ValueError as error:
            return str(error)
        if keep.offset + len(data) > keep.size:
            # Somebody else has announced another size: whose it was not begins again.
            part.unlink(missing_ok=True)
            raise Refused(f"there are more bytes than the {keep.size} announced")
        if keep.offset == 0 and sum(1 for _ in self.places.files.iterdir()) >= _MOST_FILES:
            raise Unavailable(
                f"{_MOST_FILES} files are kept already: remove some in {self.places.files}"
            )
        if shortage := self.places.disk_shortage():
            raise Unavailable(shortage)
        try:
            append_part(part, keep.offset, data)
        except OSError as error:
            raise Unavailable(f"the file cannot be written: {error}") from error
        return ""

    def _finish(self, part: Path, whole: Path, keep: FileUploadChunk) -> UploadProgress:
        if not accept_part(part, whole, keep.sha256, mode=0o400):
            return UploadProgress(
                0, complete=False, problem="the whole has another digest: begin again"
            )
        self.journal.write("file received", sha256=keep.sha256, bytes=keep.size)
        return UploadProgress(keep.size, complete=True)

    def read_chunk(self, _: LedgerReader, fetch: FileDownloadRequest) -> DownloadChunk:
        """Return a part of a file; refuses for one that is not here."""
        path = self.places.files / fetch.sha256
        try:
            data = read_part(path, fetch.offset, fetch.count)
            size = path.stat().st_size
        except OSError as error:
            raise Refused(f"there is no file {fetch.sha256}") from error
        return DownloadChunk(fetch.offset, size, fetch.sha256, *encode_chunk(data))
