"""Files that arrive in parts: traces from workers on other machines, and what submissions need.

A part lies in ``incoming`` under the lease it is sent for, if any, and the digest of the whole: so
no sender touches what another one sends. A whole is verified. A trace gets its name when the ledger
takes the result. Workers on this file system leave theirs there as a whole.
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
from daemon.batch.server._inputs import InputStore
from daemon.batch.server._runtime import EventLog
from daemon.batch.stores import append_part, file_sha256, file_size, matches_digest
from daemon.model.attachments import LARGEST_FILE
from daemon.model.ids import is_run_id
from daemon.model.messages import Completion, Count, LedgerAnswer, PutRequest
from grammars.text.files import move_durably, sync_directory

_MOST_UPLOADS: Final = 1024
"""Uploads at a time; finished traces whose result has not come count."""
_MOST_OF_ONE: Final = 64
"""Uploads of one worker, or of all submissions: a worker sends eight traces at a time."""
_IDLE: Final = 60.0
"""Seconds after which an upload that nobody goes on with gives way to a new one."""


class Uploads:
    """Takes parts of files, in one thread, and names whole traces, in the ledger's.

    Another daemon goes on with what is there. Housekeeping removes what nobody goes on with.
    """

    def __init__(self, paths: StatePaths, log: EventLog, inputs: InputStore) -> None:
        self._paths = paths
        self._log = log
        self._inputs = inputs
        self._senders: dict[str, str] = {}
        # Of folders that a daemon before this one made, and was killed before it had synchronised.
        sync_directory(paths.traces)

    def put(self, reader: LedgerReader, request: PutRequest) -> Count:
        """Add a part to its file; the answer says how many bytes are there.

        What is not needed any more counts as there: the result that follows is then answered
        accordingly. Raises :class:`Refused` for what comes under no lease of the run and for more
        bytes than announced, and :class:`Unavailable` while there is no room.
        """
        whole, sender = self._place(reader, request)
        if whole is None:
            return Count(request.size)
        if whole.exists():
            # Whoever asks is about to submit what needs it: it is no stray for now.
            with suppress(FileNotFoundError):
                os.utime(whole)
            return Count(request.size)
        part = self._paths.incoming / f"{whole.stem}.part"
        have = file_size(part)
        # Another offset: the part was sent twice, because the first answer was lost say.
        if request.data and request.offset == have:
            self._append(part, request, sender)
            have += len(request.data)
        if have < request.size:
            return Count(have)
        return Count(request.size if self._accept(part, whole, request, sender) else 0)

    def _place(self, reader: LedgerReader, request: PutRequest) -> tuple[Path | None, str]:
        """Return where the whole belongs, if it is still needed, and the worker it comes from."""
        lease = request.lease
        if lease is None:
            if request.size > LARGEST_FILE:
                raise Refused(f"a file has at most {LARGEST_FILE} bytes, not {request.size}")
            if not request.data:
                # The good copy is in hand now: one that was damaged here gives way to it.
                self._inputs.examine(request.sha256)
            return self._paths.files / request.sha256, ""
        if not is_run_id(lease.run):
            raise Refused(f"{lease.run!r} is not the id of a run")
        expected = reader.expected_upload(lease.run, lease.token, request.era)
        # Only when the sender asks how far it is: reading all of a trace at every part of it
        # would make an upload quadratic.
        there = self._paths.trace(expected.name)
        is_there = not request.data and matches_digest(there, request.size, request.sha256)
        if is_there or not expected.is_needed:
            return None, expected.worker
        whole = self._paths.uploaded_trace(lease.run, lease.token, request.sha256)
        return whole, expected.worker

    def _append(self, part: Path, request: PutRequest, sender: str) -> None:
        if request.offset + len(request.data) > request.size:
            # Somebody else has announced another size: whose it was not begins again.
            part.unlink(missing_ok=True)
            raise Refused(f"there are more bytes than the {request.size} announced")
        if request.offset == 0:
            self._make_room(part.stem, request, sender)
        if shortage := self._paths.disk_shortage():
            raise Unavailable(shortage)
        try:
            append_part(part, request.offset, request.data)
        except OSError as error:
            raise Unavailable(f"{part.name} cannot be written: {error}") from error

    def _make_room(self, name: str, request: PutRequest, sender: str) -> None:
        """Look whether another upload can begin; what was sent under this lease before goes."""
        if request.lease is not None:
            # Not what others send of the same run: the first that is complete counts.
            self._remove(f"{request.lease.run}.{request.lease.token}")
        if self._paths.disk().free < request.size:
            raise Unavailable(f"no room for the {request.size} bytes of {name}")
        ages = self._ages()
        self._senders = {one: by for one, by in self._senders.items() if one in ages}
        own = [one for one, by in self._senders.items() if by == sender]
        for uploads, most in ((own, _MOST_OF_ONE), (list(ages), _MOST_UPLOADS)):
            if len(uploads) < most:
                continue
            oldest = max(uploads, key=ages.__getitem__)
            if ages[oldest] < _IDLE:
                raise Unavailable(f"{most} files are on their way already: this one has to wait")
            self._remove(oldest)
        self._senders[name] = sender

    def _remove(self, beginning: str) -> None:
        # Once for every result: a pattern of pathlib took 0.1 ms more, most of it to compile.
        for path in self._paths.incoming.iterdir():
            if path.name.startswith(f"{beginning}."):
                path.unlink(missing_ok=True)

    def _ages(self) -> dict[str, float]:
        """Return for how long nobody has gone on with each upload [s]."""
        ages, now = {}, time.time()
        for path in self._paths.incoming.iterdir():
            with suppress(FileNotFoundError):
                # A clock that was set back must not keep anything for ever.
                ages[path.stem] = abs(now - path.stat().st_mtime)
        return ages

    def _accept(self, part: Path, whole: Path, request: PutRequest, sender: str) -> bool:
        """Give a file that is complete its name if it is the one that was announced."""
        part.touch(mode=0o600)  # an empty file comes without a single part
        if file_sha256(part) != request.sha256:
            part.unlink()
            self._log.write("file damaged", name=whole.name, worker=sender)
            return False
        if request.lease is None:
            # For reading only: what has this name has this digest, for every run to come.
            part.chmod(0o400)
        move_durably(part, whole)
        what = "trace" if request.lease else "file"
        self._log.write(f"{what} received", name=whole.name, worker=sender, bytes=request.size)
        return True

    def is_missing(self, ledger: LedgerWriter, completion: Completion) -> bool:
        """Whether a result would be recorded whose trace is not here."""
        if not ledger.awaits_result(completion.run, completion.token):
            return False
        if self._whole(completion).exists():
            return False
        # Named already, by a daemon that ended before the commit.
        name, _ = ledger.trace_location(completion.run)
        info = completion.result.trace
        return not matches_digest(self._paths.trace(name), info.size, info.sha256)

    def settle_result(
        self, ledger: LedgerWriter, completion: Completion, answer: LedgerAnswer
    ) -> None:
        """Do with a trace what became of its result: give it its name, or drop it."""
        # Before the ledger commits, so that what it then says is true also when this process ends
        # here: a trace without its result the next attempt replaces, a result without its trace
        # would stay so.
        name, location = ledger.trace_location(completion.run)
        there, whole = self._paths.trace(name), self._whole(completion)
        # A repetition of a run whose trace was removed brings it back.
        is_lost = answer is LedgerAnswer.KNOWN and not location and not there.exists()
        is_recorded = answer is LedgerAnswer.RECORDED
        if whole.exists() and (is_recorded or is_lost):
            if not there.parent.exists():
                there.parent.mkdir(mode=0o700)
                ledger.sync_before_commit(there.parent.parent)
            whole.replace(there)
            # Once for all results that share the commit: measured, 5 ms each on one disk.
            ledger.sync_before_commit(there.parent)
        # The first result makes uploads under all other leases pointless, too: their senders
        # hear so when they go on.
        self._remove(completion.run if is_recorded else f"{completion.run}.{completion.token}")

    def _whole(self, completion: Completion) -> Path:
        sha256 = completion.result.trace.sha256
        return self._paths.uploaded_trace(completion.run, completion.token, sha256)
