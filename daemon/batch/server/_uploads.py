"""Files of the state directory: inputs of runs, and uploads in parts of traces and inputs.

A part is stored in ``incoming`` under its lease, if any, and the digest of the whole, so senders do
not interfere with each other. Complete files are verified. A trace gets its final name when the
ledger takes the result. Workers on this file system put complete traces there.
"""

from __future__ import annotations

import os
import time
from contextlib import suppress
from pathlib import Path
from typing import Final

from daemon.batch.errors import Refused, Unavailable
from daemon.batch.ledger import LedgerReader, LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.batch.server._runtime import EventLog
from daemon.batch.stores import append_part, file_sha256, file_size, is_intact, matches_digest
from daemon.model.attachments import LARGEST_FILE
from daemon.model.ids import is_digest, is_run_id
from daemon.model.messages import Completion, Count, LedgerAnswer, PutRequest
from daemon.model.spec import RunSpec
from grammars.text.files import move_durably, sync_directory

_MOST_UPLOADS: Final = 1024
"""Most uploads at a time, including complete traces that wait for their result."""
_IDLE: Final = 60.0
"""Time without progress after which an upload may be replaced by a new one [s]."""


class DaemonFiles:
    """Inputs and traces in the state directory.

    Looks up inputs in any thread, takes parts of files in one, and names complete traces in the
    ledger's. A campaign with a missing input is not leased: it waits, with that as its reason,
    until it is submitted again. The next daemon goes on with incomplete uploads. Housekeeping
    removes abandoned ones.
    """

    def __init__(self, paths: StatePaths, log: EventLog) -> None:
        self._paths = paths
        self._log = log
        # An earlier daemon may have been killed before it had synchronised new folders.
        sync_directory(paths.traces)

    def missing(self, spec: RunSpec) -> str:
        """Return a missing input of a run as ``scene`` or ``file`` and a digest, or empty text."""
        files = (self._paths.files / digest for digest in spec.files if is_digest(digest))
        paths = [self._paths.scene(spec.scene), *files]
        absent = next((path for path in paths if not path.exists()), None)
        if absent is None:
            return ""
        self._log.write("input missing", path=str(absent))
        return f"{'scene' if absent.suffix else 'file'} {absent.stem}"

    def has(self, item: str) -> bool:
        """Return whether an input, named as by :meth:`missing`, is here."""
        kind, _, digest = item.partition(" ")
        path = self._paths.scene(digest) if kind == "scene" else self._paths.files / digest
        return path.exists()

    def examine(self, digest: str) -> None:
        """Verify a scene or file against its digest; put it aside if they differ."""
        if not is_digest(digest):
            return
        for path in (self._paths.scene(digest), self._paths.files / digest):
            if path.exists() and not is_intact(path):
                aside = self._paths.put_aside(path)
                self._log.write("input damaged", path=str(path), aside=str(aside))

    def put(self, reader: LedgerReader, request: PutRequest) -> Count:
        """Add a part to its file; return the number of bytes received so far.

        An unneeded file counts as complete; the answer to its result then tells the worker. Raises
        :class:`Refused` for an unknown lease and for more bytes than announced, and
        :class:`Unavailable` while there is no space.
        """
        whole = self._place(reader, request)
        if whole is None:
            return Count(request.size)
        if whole.exists():
            # Touch it, so that it is not a stray before the submission that needs it.
            with suppress(FileNotFoundError):
                os.utime(whole)
            return Count(request.size)
        part = self._paths.incoming / f"{whole.stem}.part"
        have = file_size(part)
        # At another offset the part was sent twice, as after a lost answer.
        if request.data and request.offset == have:
            self._append(part, request)
            have += len(request.data)
        if have < request.size:
            return Count(have)
        return Count(request.size if self._accept(part, whole, request) else 0)

    def _place(self, reader: LedgerReader, request: PutRequest) -> Path | None:
        """Return the path of the complete file, or ``None`` if it is not needed."""
        lease = request.lease
        if lease is None:
            if request.size > LARGEST_FILE:
                raise Refused(f"a file has at most {LARGEST_FILE} bytes, not {request.size}")
            if not request.data:
                # A good copy is available now: check whether ours is damaged.
                self.examine(request.sha256)
            return self._paths.files / request.sha256
        if not is_run_id(lease.run):
            raise Refused(f"{lease.run!r} is not the id of a run")
        name, is_needed = reader.expected_trace(lease.run, lease.token, request.era)
        # Only for a request without data: reading the whole trace at every part would make an
        # upload quadratic.
        trace = self._paths.trace(name)
        is_complete = not request.data and matches_digest(trace, request.size, request.sha256)
        if is_complete or not is_needed:
            return None
        return self._paths.uploaded_trace(lease.run, lease.token, request.sha256)

    def _append(self, part: Path, request: PutRequest) -> None:
        if request.offset + len(request.data) > request.size:
            # Another sender has announced another size: begin again.
            part.unlink(missing_ok=True)
            raise Refused(f"the file has more bytes than the announced {request.size}")
        if request.offset == 0:
            self._make_room(part.stem, request)
        if shortage := self._paths.disk_shortage():
            raise Unavailable(shortage)
        try:
            append_part(part, request.offset, request.data)
        except OSError as error:
            raise Unavailable(f"{part.name} cannot be written: {error}") from error

    def _make_room(self, name: str, request: PutRequest) -> None:
        """Check the limits for a new upload; remove earlier ones under its lease."""
        if request.lease is not None:
            # Uploads of the same run under other leases stay: the first complete one counts.
            self._remove(f"{request.lease.run}.{request.lease.token}")
        if self._paths.disk().free < request.size:
            raise Unavailable(f"no space for the {request.size} bytes of {name}")
        ages = self._ages()
        if len(ages) >= _MOST_UPLOADS:
            oldest = max(ages, key=ages.__getitem__)
            if ages[oldest] < _IDLE:
                words = f"{_MOST_UPLOADS} uploads are in progress: this one has to wait"
                raise Unavailable(words)
            self._remove(oldest)

    def _remove(self, beginning: str) -> None:
        # Called for every result: a pattern of pathlib takes 0.1 ms more, mostly to compile.
        for path in self._paths.incoming.iterdir():
            if path.name.startswith(f"{beginning}."):
                path.unlink(missing_ok=True)

    def _ages(self) -> dict[str, float]:
        """Return the time since the last progress of each upload [s]."""
        ages, now = {}, time.time()
        for path in self._paths.incoming.iterdir():
            with suppress(FileNotFoundError):
                # Absolute, since a clock may be set back.
                ages[path.stem] = abs(now - path.stat().st_mtime)
        return ages

    def _accept(self, part: Path, whole: Path, request: PutRequest) -> bool:
        """Verify a complete file and give it its name; return whether it was as announced."""
        part.touch(mode=0o600)  # an empty file has no parts
        if file_sha256(part) != request.sha256:
            part.unlink()
            self._log.write("file damaged", name=whole.name)
            return False
        if request.lease is None:
            # Read-only: its name is the digest of its content.
            part.chmod(0o400)
        move_durably(part, whole)
        what = "trace" if request.lease else "file"
        self._log.write(f"{what} received", name=whole.name, bytes=request.size)
        return True

    def is_missing(self, ledger: LedgerWriter, completion: Completion) -> bool:
        """Return whether a result would be recorded without its trace."""
        if not ledger.awaits_result(completion.run, completion.token):
            return False
        if self._whole(completion).exists():
            return False
        # A daemon that ended before the commit may have named it already.
        name, _ = ledger.trace_location(completion.run)
        info = completion.result.trace
        return not matches_digest(self._paths.trace(name), info.size, info.sha256)

    def settle_result(
        self, ledger: LedgerWriter, completion: Completion, answer: LedgerAnswer
    ) -> None:
        """Name the trace of a recorded result, or remove it."""
        # Before the commit, in case this process ends here: the next attempt replaces a trace
        # without a result, but a result without its trace would stay so.
        name, location = ledger.trace_location(completion.run)
        trace, whole = self._paths.trace(name), self._whole(completion)
        # A repetition restores a trace that was removed.
        is_lost = answer is LedgerAnswer.KNOWN and not location and not trace.exists()
        is_recorded = answer is LedgerAnswer.RECORDED
        if whole.exists() and (is_recorded or is_lost):
            if not trace.parent.exists():
                trace.parent.mkdir(mode=0o700)
                ledger.sync_before_commit(trace.parent.parent)
            whole.replace(trace)
            # Once for all results of the commit: measured, 5 ms each on one disk.
            ledger.sync_before_commit(trace.parent)
        # The first result also ends uploads under all other leases: their senders learn it with
        # the next part.
        self._remove(completion.run if is_recorded else f"{completion.run}.{completion.token}")

    def _whole(self, completion: Completion) -> Path:
        sha256 = completion.result.trace.sha256
        return self._paths.uploaded_trace(completion.run, completion.token, sha256)
