"""The intake: traces that workers on other machines send in parts, until their runs are complete.

A part lies under the run, the lease and the digest it is sent for, so that no sender touches what
another one sends. It gets a name of a trace only when all of it is there, verified, and the
ledger takes the result.
"""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from daemon.errors import Refused, Troubled
from daemon.ledger import Book, Reader
from daemon.messages import Answer, Chunk, Completion, Received
from daemon.places import Places, is_digest, is_run_id, sync_directory
from daemon.server._journal import Journal
from daemon.store import accept_part, add_part, is_file_of, make_folder, size_of, unpacked

_MOST: Final = 1024
"""Uploads at a time, finished ones whose result has not come included."""
_STALE: Final = 3600.0
"""Seconds after which an upload that nobody goes on with is given up."""
_SWEEP: Final = 60.0


@dataclass(slots=True)
class _Upload:
    part: Path
    whole: Path
    chunk: Chunk

    @property
    def offset(self) -> int:
        """How many bytes there are."""
        return size_of(self.part)


@dataclass(slots=True)
class Intake:
    """Takes chunks, in one thread, and hands whole traces over, in the ledger's."""

    places: Places
    journal: Journal
    _begun: dict[str, float] = field(default_factory=dict)
    _sweep_at: float = 0.0

    def take(self, reader: Reader, chunk: Chunk) -> Received:
        """Add a chunk to its upload; the answer says where to go on.

        Refuses what comes under no lease, or a stale one; raises :class:`Troubled` while there is
        no room.
        """
        if not is_run_id(chunk.run) or not is_digest(chunk.sha256):
            raise Refused(f"{chunk.run!r} is not the id of a run")
        self._sweep()
        wanted = reader.upload(chunk.run, chunk.token)
        upload = self._upload(chunk)
        there = self.places.trace(wanted.name)
        if not wanted.wanted or upload.whole.exists():
            return Received(chunk.size, complete=True)
        if not chunk.data and is_file_of(there, chunk.size, chunk.sha256):
            return Received(chunk.size, complete=True)
        problem = self._add(upload) if chunk.data else ""
        if not problem and upload.offset == chunk.size:
            return self._finish(upload)
        return Received(upload.offset, complete=False, problem=problem)

    def _upload(self, chunk: Chunk) -> _Upload:
        name = f"{chunk.run}.{chunk.token}.{chunk.sha256}"
        folder = self.places.incoming
        return _Upload(folder / f"{name}.part", folder / f"{name}.mcap", chunk)

    def _add(self, upload: _Upload) -> str:
        chunk = upload.chunk
        if chunk.offset != upload.offset:
            return f"the chunk begins at {chunk.offset}, expected is {upload.offset}"
        try:
            data = unpacked(chunk.data, chunk.digest)
        except ValueError as error:
            return str(error)
        if chunk.offset + len(data) > chunk.size:
            raise Refused(f"{chunk.run}: there are more bytes than the {chunk.size} announced")
        if chunk.offset == 0:
            self._make_room(chunk)
        if shortage := self.places.shortage():
            raise Troubled(shortage)
        try:
            add_part(upload.part, chunk.offset, data)
        except OSError as error:
            raise Troubled(f"the trace of {chunk.run} cannot be written: {error}") from error
        return ""

    def _make_room(self, chunk: Chunk) -> None:
        """Look whether another upload can begin; what was sent of this run before goes."""
        for path in self.places.incoming.glob(f"{chunk.run}.*"):
            path.unlink(missing_ok=True)
        if sum(1 for _ in self.places.incoming.iterdir()) >= _MOST:
            raise Troubled(f"{_MOST} traces are on their way already: this one has to wait")
        if self.places.disk().free < chunk.size:
            raise Troubled(f"no room for the {chunk.size} bytes of the trace of {chunk.run}")
        self._begun[chunk.run] = time.monotonic()

    def _finish(self, upload: _Upload) -> Received:
        chunk = upload.chunk
        if not accept_part(upload.part, upload.whole, chunk.sha256):
            self.journal.write("trace damaged", run=chunk.run, worker=chunk.worker)
            return Received(0, complete=False, problem="the whole has another digest: begin again")
        begun = self._begun.pop(chunk.run, None)
        took = None if begun is None else round(time.monotonic() - begun, 3)
        self.journal.write(
            "trace received", run=chunk.run, worker=chunk.worker, bytes=chunk.size, seconds=took
        )
        return Received(chunk.size, complete=True)

    def lacks(self, book: Book, completion: Completion) -> bool:
        """Whether a result would be recorded whose trace is not here (and in no store)."""
        if completion.location or not book.awaited(completion.run):
            return False
        name, _ = book.trace_of(completion.run)
        there = self.places.trace(name)
        if not completion.uploaded:
            return not there.is_file()
        if self._whole(completion).exists():
            return False
        return not is_file_of(there, completion.result.trace.size, completion.result.trace.sha256)

    def settle(self, book: Book, completion: Completion, answer: Answer) -> None:
        """Do with a trace what became of its result: give it its name, or drop it.

        Before the ledger commits: what it then says is true, also when this is the end.
        """
        name, location = book.trace_of(completion.run)
        there = self.places.trace(name)
        if answer is Answer.KNOWN and not location and not there.exists() and completion.location:
            book.move_trace(completion.run, completion.location)
        if not completion.uploaded:
            return
        whole = self._whole(completion)
        # A repetition of a run whose trace was removed brings it back.
        lost = answer is Answer.KNOWN and not location and not there.exists()
        if whole.exists() and (answer is Answer.RECORDED or lost):
            make_folder(there.parent)
            whole.replace(there)
            sync_directory(there.parent)
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
