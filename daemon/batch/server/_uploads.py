"""Uploads in parts: traces from workers on other machines, files of systems under test.

A part of a trace lies under the run, the lease and the digest it is sent for, so that no sender
touches what another one sends. It gets a name of a trace only when all of it is there, verified,
and the ledger takes the result. Files are kept by digest, and given to workers.
"""

from __future__ import annotations

import os
import time
from abc import ABC, abstractmethod
from contextlib import suppress
from pathlib import Path
from typing import Final, Generic, TypeVar

from daemon.batch.errors import Refused, Unavailable
from daemon.batch.inputs import verify_file
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
"""Uploads at a time, of traces or of files; finished traces whose result has not come count."""
_STALE: Final = 3600.0
"""Seconds after which an upload that nobody goes on with is given up."""
_SWEEP: Final = 60.0

Chunk = TypeVar("Chunk", TraceUploadChunk, FileUploadChunk)


class _Uploads(ABC, Generic[Chunk]):
    """Takes parts of files, in one thread; the daemon's side of :class:`FileUpload`.

    Nothing is remembered between two parts but the file itself: another daemon goes on with it.
    """

    def __init__(self, paths: StatePaths, log: EventLog) -> None:
        self.paths = paths
        self._log = log

    @abstractmethod
    def _what(self, chunk: Chunk) -> str:
        """What is sent, as messages call it."""

    @abstractmethod
    def _make_room(self, chunk: Chunk) -> None:
        """See whether another upload can begin; raises :class:`Unavailable`."""

    @abstractmethod
    def _log_end(self, chunk: Chunk, *, accepted: bool) -> None:
        """Write down that all of it came, and whether it is what was announced."""

    def _receive(
        self, part: Path, whole: Path, chunk: Chunk, *, mode: int | None = None
    ) -> UploadProgress:
        """Add a part, or only say where to go on; gives the file its name when it is whole."""
        problem = self._append(part, chunk) if chunk.data else ""
        have = file_size(part)
        if problem or have != chunk.size:
            return UploadProgress(have, complete=False, problem=problem)
        accepted = accept_part(part, whole, chunk.sha256, mode=mode)
        self._log_end(chunk, accepted=accepted)
        if accepted:
            return UploadProgress(chunk.size, complete=True)
        problem = "the whole has another digest: begin again"
        return UploadProgress(0, complete=False, problem=problem)

    def _append(self, part: Path, chunk: Chunk) -> str:
        """Add a part; returns what is wrong with it if it is to be sent again."""
        have = file_size(part)
        if chunk.offset != have:
            # Sent twice, because the first answer was lost say: the sender goes on from here.
            return f"the chunk begins at {chunk.offset}, expected is {have}"
        try:
            data = decode_chunk(chunk.data, chunk.digest)
        except ValueError as error:
            return str(error)
        if have + len(data) > chunk.size:
            # Somebody else has announced another size: whose it was not begins again.
            part.unlink(missing_ok=True)
            raise Refused(
                f"{self._what(chunk)}: there are more bytes than the {chunk.size} announced"
            )
        if chunk.offset == 0:
            self._make_room(chunk)
        if shortage := self.paths.disk_shortage():
            raise Unavailable(shortage)
        try:
            append_part(part, have, data)
        except OSError as error:
            raise Unavailable(f"{self._what(chunk)} cannot be written: {error}") from error
        return ""


class TraceUploads(_Uploads[TraceUploadChunk]):
    """Takes chunks, in one thread, and hands whole traces over, in the ledger's."""

    def __init__(self, paths: StatePaths, log: EventLog, *, most: int = _MOST_UPLOADS) -> None:
        super().__init__(paths, log)
        self._most = most
        self._begun: dict[int, float] = {}
        self._sweep_at = 0.0

    def add_chunk(self, reader: LedgerReader, chunk: TraceUploadChunk) -> UploadProgress:
        """Add a chunk to its upload; the answer says where to go on.

        What is not needed any more counts as complete: the result that follows is then answered
        accordingly. Refuses what comes under no lease of the run; raises
        :class:`Unavailable` while there is no room.
        """
        if not is_run_id(chunk.run) or not is_digest(chunk.sha256):
            raise Refused(f"{chunk.run!r} is not the id of a run")
        self._sweep()
        expected = reader.expected_upload(chunk.run, chunk.token, chunk.era)
        whole = self._whole(chunk.run, chunk.token, chunk.sha256)
        if not expected.wanted or whole.exists():
            return UploadProgress(chunk.size, complete=True)
        # Only when the sender asks where to begin: reading all of a trace at every part of it
        # would make an upload quadratic.
        there = self.paths.trace(expected.name)
        if not chunk.data and matches_digest(there, chunk.size, chunk.sha256):
            return UploadProgress(chunk.size, complete=True)
        return self._receive(whole.with_suffix(".part"), whole, chunk)

    def _whole(self, run: str, token: int, sha256: str) -> Path:
        return self.paths.incoming / f"{run}.{token}.{sha256}.mcap"

    def _what(self, chunk: TraceUploadChunk) -> str:
        return f"the trace of {chunk.run}"

    def _make_room(self, chunk: TraceUploadChunk) -> None:
        """Look whether another upload can begin; what was sent under this lease before goes."""
        # Not what others send of the same run: the first that is complete counts.
        for path in self.paths.incoming.glob(f"{chunk.run}.{chunk.token}.*"):
            path.unlink(missing_ok=True)
        if sum(1 for _ in self.paths.incoming.iterdir()) >= self._most:
            raise Unavailable(f"{self._most} traces are on their way already: this one has to wait")
        if self.paths.disk().free < chunk.size:
            raise Unavailable(f"no room for the {chunk.size} bytes of the trace of {chunk.run}")
        self._begun[chunk.token] = time.monotonic()

    def _log_end(self, chunk: TraceUploadChunk, *, accepted: bool) -> None:
        if not accepted:
            self._log.write("trace damaged", run=chunk.run, worker=chunk.worker)
            return
        begun = self._begun.pop(chunk.token, None)
        took = None if begun is None else round(time.monotonic() - begun, 3)
        self._log.write(
            "trace received", run=chunk.run, worker=chunk.worker, bytes=chunk.size, seconds=took
        )

    def is_missing(self, ledger: LedgerWriter, completion: Completion) -> bool:
        """Whether a result would be recorded whose trace is not here."""
        if not ledger.awaits_result(completion.run, completion.token):
            return False
        name, _ = ledger.trace_location(completion.run)
        there, info = self.paths.trace(name), completion.result.trace
        if not completion.uploaded:
            return not there.is_file()
        if self._completed(completion).exists():
            return False
        return not matches_digest(there, info.size, info.sha256)

    def settle_result(
        self, ledger: LedgerWriter, completion: Completion, answer: LedgerAnswer
    ) -> None:
        """Do with a trace what became of its result: give it its name, or drop it."""
        # Before the ledger commits, so that what it then says is true also when this process ends
        # here: a trace without its result the next attempt replaces, a result without its trace
        # would stay so.
        name, location = ledger.trace_location(completion.run)
        there = self.paths.trace(name)
        # A repetition of a run whose trace was removed brings it back.
        lost = answer is LedgerAnswer.KNOWN and not location and not there.exists()
        recorded = answer is LedgerAnswer.RECORDED
        if completion.uploaded:
            whole = self._completed(completion)
            if whole.exists() and (recorded or lost):
                make_folder(there.parent)
                move_durably(whole, there)
        if completion.uploaded or recorded:
            # The first result makes uploads under all other leases pointless, too: their senders
            # hear so when they go on.
            which = "*" if recorded else f"{completion.token}.*"
            for path in self.paths.incoming.glob(f"{completion.run}.{which}"):
                path.unlink(missing_ok=True)

    def _completed(self, completion: Completion) -> Path:
        sha256 = completion.result.trace.sha256
        if not is_digest(sha256):
            raise Refused(f"{sha256[:70]!r} is not the digest of a trace")
        return self._whole(completion.run, completion.token, sha256)

    def _sweep(self) -> None:
        """Remove uploads that nobody has gone on with for long."""
        now = time.monotonic()
        if now < self._sweep_at:
            return
        self._sweep_at = now + _SWEEP
        self._begun = {token: at for token, at in self._begun.items() if now - at < _STALE}
        for path in self.paths.incoming.iterdir():
            with suppress(FileNotFoundError):
                idle = time.time() - path.stat().st_mtime
                # A clock that was set back must not keep anything for ever.
                if abs(idle) > _STALE:
                    path.unlink()
                    self._log.write("upload given up", name=path.name)


class FileUploads(_Uploads[FileUploadChunk]):
    """The files there are; used in one thread."""

    def add_chunk(self, _: LedgerReader, chunk: FileUploadChunk) -> UploadProgress:
        """Add a part to a file, whoever sends it; the answer says where to go on.

        Raises :class:`Unavailable` while there is no room.
        """
        whole = self.paths.files / chunk.sha256
        # Only when the sender asks where to begin: the good copy is in hand then, and one that was
        # damaged here gives way to it.
        if whole.exists() and not chunk.data and not verify_file(whole):
            aside = self.paths.put_aside(whole)
            self._log.write("input damaged", path=str(whole), aside=str(aside))
        if whole.exists():
            # Whoever asks is about to submit a campaign that needs it.
            with suppress(FileNotFoundError):
                os.utime(whole)
            return UploadProgress(chunk.size, complete=True)
        # For reading only: what has this name has this digest, for every run to come.
        return self._receive(self.paths.files / f".{chunk.sha256}.part", whole, chunk, mode=0o400)

    def _what(self, chunk: FileUploadChunk) -> str:
        return "the file"

    def _make_room(self, chunk: FileUploadChunk) -> None:
        if sum(1 for _ in self.paths.files.glob(".*.part")) >= _MOST_UPLOADS:
            raise Unavailable(
                f"{_MOST_UPLOADS} files are on their way already: this one has to wait"
            )

    def _log_end(self, chunk: FileUploadChunk, *, accepted: bool) -> None:
        if accepted:
            self._log.write("file received", sha256=chunk.sha256, bytes=chunk.size)

    def read_chunk(self, _: LedgerReader, request: FileDownloadRequest) -> DownloadChunk:
        """Return a part of a file; refuses for one that is not here."""
        path = self.paths.files / request.sha256
        try:
            data = read_part(path, request.offset)
            size = path.stat().st_size
        except OSError as error:
            raise Refused(f"there is no file {request.sha256}") from error
        return DownloadChunk(request.offset, size, request.sha256, *encode_chunk(data))
