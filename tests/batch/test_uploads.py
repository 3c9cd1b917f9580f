"""Parts of files at the daemon, without a bus: in order, damaged, hostile, stale, too many."""

import hashlib
import os
import random
import sqlite3
from dataclasses import replace

import pytest

from daemon.batch.errors import Refused, Unavailable
from daemon.batch.paths import StatePaths
from daemon.batch.server import _uploads
from daemon.batch.server._runtime import EventLog
from daemon.batch.server._uploads import DaemonFiles
from daemon.model.messages import (
    Completion,
    LeaseRef,
    LedgerAnswer,
    PutRequest,
    RetryRequest,
)
from daemon.model.spec import TraceInfo
from daemon.model.verdicts import Outcome, RunState
from tests.batch.conftest import NOW
from tests.make import make_result

TRACE = random.Random(1).randbytes(1000)


class Site:
    """A ledger with one leased run, and the intake beside it."""

    def __init__(self, ledger, journal):
        self.places, self.book, self.reader = ledger.places, ledger.book, ledger.reader
        self.journal = journal
        self.book.begin_era()
        ledger.submit("c", 1)
        (self.grant,) = ledger.lease()
        self.begin_again()

    def part(self, offset, data, *, run="", token=None, **changes):
        sha256 = hashlib.sha256(TRACE).hexdigest()
        lease = LeaseRef(run or self.grant.run, self.grant.token if token is None else token)
        made = PutRequest(sha256, len(TRACE), offset, data, lease, self.grant.era)
        return replace(made, **changes)

    def take(self, offset, data, **changes):
        """Take a part; returns how many bytes are there."""
        return self.intake.put(self.reader, self.part(offset, data, **changes)).count

    def begin_again(self):
        """Have another daemon go on."""
        self.intake = DaemonFiles(self.places, self.journal)

    def leave_idle(self):
        """Have nobody go on with what there is for two minutes."""
        for path in self.places.incoming.iterdir():
            at = path.stat().st_mtime - 120.0
            os.utime(path, (at, at))

    def completion(self, data=TRACE, **changes):
        info = TraceInfo(hashlib.sha256(data).hexdigest(), len(data), 1)
        result = make_result(self.grant.spec, trace=info)
        made = Completion("w", self.grant.run, 1, self.grant.token, result)
        return replace(made, **changes)

    def complete(self, completion):
        """What the daemon does with a completion."""
        with self.book.transaction():
            return self.settle(completion)

    def settle(self, completion):
        if self.intake.is_missing(self.book, completion):
            return LedgerAnswer.MISSING
        answer = self.book.complete(completion, NOW)
        self.intake.settle_result(self.book, completion, answer)
        return answer

    @property
    def trace(self):
        return self.places.trace(self.grant.trace)

    def incoming(self):
        return sorted(path.suffix for path in self.places.incoming.iterdir())


@pytest.fixture
def site(ledger):
    journal = EventLog(ledger.places.log)
    yield Site(ledger, journal)
    journal.close()


def test_a_trace_arrives_in_parts_and_gets_its_name_with_the_result(site):
    assert site.take(0, b"") == 0
    assert site.take(0, TRACE[:400]) == 400
    assert site.take(400, TRACE[400:]) == 1000
    assert not site.trace.exists()
    assert site.complete(site.completion()) is LedgerAnswer.RECORDED
    assert site.trace.read_bytes() == TRACE
    assert site.incoming() == []


def complete_without_commit(site):
    with site.book.transaction():
        site.settle(site.completion())
        raise sqlite3.OperationalError("disk I/O error")


def test_a_daemon_that_named_the_trace_and_did_not_commit_loses_nothing(site):
    site.take(0, TRACE)
    with pytest.raises(Unavailable):
        complete_without_commit(site)
    assert site.take(0, b"") == 1000
    assert site.complete(site.completion()) is LedgerAnswer.RECORDED
    assert site.trace.read_bytes() == TRACE


def test_the_name_of_a_trace_is_on_the_disk_before_its_result(site, monkeypatch):
    synced = {}

    def sync(folder):
        synced[folder.name] = site.reader.run("c.0").row.state

    monkeypatch.setattr("daemon.batch.ledger._writer.sync_directory", sync)
    site.take(0, TRACE)
    assert site.complete(site.completion()) is LedgerAnswer.RECORDED
    assert synced == {"c": RunState.RUNNING, "traces": RunState.RUNNING}


def test_of_two_workers_on_this_file_system_the_first_result_keeps_its_trace(site):
    """Also of a system that gives something else every time."""
    leave(site.places, site.completion())
    site.book.lapse(site.book.leases(), NOW)
    (again,) = site.book.lease("v", 1, NOW + 1000.0)
    other = site.completion(b"something else", token=again.token)
    leave(site.places, other, b"something else")
    assert site.complete(site.completion()) is LedgerAnswer.RECORDED
    assert site.complete(other) is not LedgerAnswer.RECORDED
    assert site.trace.read_bytes() == TRACE
    assert site.incoming() == []


def leave(places, completion, data=TRACE):
    """Leave a whole trace there, as a worker on this file system does."""
    sha256 = completion.result.trace.sha256
    places.uploaded_trace(completion.run, completion.token, sha256).write_bytes(data)


def test_a_part_that_does_not_continue_changes_nothing(site):
    site.take(0, TRACE[:400])
    for offset in (0, 399, 401, 2**50):
        assert site.take(offset, TRACE[:100]) == 400


def test_a_whole_that_is_another_one_begins_again(site):
    with pytest.raises(Refused, match="more bytes than the announced 1000"):
        site.take(0, TRACE + b"!")
    assert site.take(0, TRACE[:-1] + b"!") == 0
    assert site.incoming() == []
    assert site.take(0, TRACE) == 1000


def test_a_result_without_its_trace_is_not_recorded(site):
    assert site.complete(site.completion()) is LedgerAnswer.MISSING
    site.take(0, TRACE[:400])
    assert site.complete(site.completion()) is LedgerAnswer.MISSING
    site.trace.parent.mkdir()
    site.trace.write_bytes(b"of another attempt")
    assert site.complete(site.completion()) is LedgerAnswer.MISSING
    assert site.book.awaits_result("c.0", site.grant.token)


def test_whoever_was_ever_leased_the_run_may_send(site):
    """Late or not, while there is no result; the parts of two do not get into each other's way."""
    for token in (0, site.grant.token + 1):
        with pytest.raises(Refused, match="never leased"):
            site.take(0, TRACE[:400], token=token)
    assert site.incoming() == []
    site.take(0, TRACE[:400])
    site.book.lapse(site.book.leases(), NOW + 1000.0)
    (again,) = site.book.lease("v", 1, NOW + 2000.0)
    assert site.take(0, TRACE[:300], token=again.token) == 300
    assert site.take(400, TRACE[400:]) == 1000
    assert site.incoming() == [".mcap", ".part"]
    assert site.complete(site.completion()) is LedgerAnswer.RECORDED
    assert site.trace.read_bytes() == TRACE
    assert site.incoming() == []
    # What the other one has is not needed any more, and its result is compared with the first.
    assert site.take(300, TRACE[300:], token=again.token) == 1000
    assert site.complete(site.completion(token=again.token)) is LedgerAnswer.KNOWN
    assert site.trace.read_bytes() == TRACE


def test_what_was_executed_before_another_result_was_asked_for_is_not_needed(site):
    site.take(0, TRACE)
    first = site.completion()
    stopped = replace(first.result, outcome=Outcome.ERROR, stopped=True)
    assert site.complete(replace(first, result=stopped)) is LedgerAnswer.RECORDED
    site.trace.unlink()
    assert site.book.retry(RetryRequest("c", ("error",)), NOW) == 1
    assert site.take(0, TRACE) == 1000
    assert site.complete(first) is LedgerAnswer.REDUNDANT
    assert site.book.awaits_result("c.0", site.grant.token + 1)
    assert (site.incoming(), site.trace.exists()) == ([], False)


def test_what_is_cancelled_is_not_wanted(site):
    site.take(0, TRACE[:400])
    site.book.cancel("c", NOW)
    assert site.take(400, TRACE[400:]) == 1000  # nothing is written
    assert site.complete(site.completion()) is LedgerAnswer.DROPPED
    assert site.incoming() == []


def test_once_a_result_is_there_its_trace_stays_and_comes_back_where_it_is_gone(site):
    site.take(0, TRACE)
    site.complete(site.completion())
    assert site.take(0, b"") == 1000  # an acknowledgement was lost
    assert site.complete(site.completion()) is LedgerAnswer.KNOWN
    assert site.complete(site.completion(b"something else")) is LedgerAnswer.DIFFERS
    assert site.trace.read_bytes() == TRACE
    site.book.retry(RetryRequest("c", ("all",)), NOW)
    (site.grant,) = site.book.lease("w", 1, NOW)
    assert site.take(0, b"") == 1000  # it lies there already
    site.trace.unlink()
    assert site.take(0, b"") == 0
    site.take(0, TRACE)
    assert site.complete(site.completion()) is LedgerAnswer.KNOWN
    assert site.trace.read_bytes() == TRACE


# --- files of submissions


def other_file(number, data=b"begun", **changes):
    """The beginning of another file of a submission."""
    return replace(PutRequest(f"{number:064x}", 10, 0, data), **changes)


@pytest.fixture
def put(site):
    """Hand a part of the file to the daemon; returns how many bytes it has."""

    def put(offset, data):
        digest = hashlib.sha256(TRACE).hexdigest()
        return site.intake.put(None, PutRequest(digest, len(TRACE), offset, data)).count

    return put


def test_the_daemon_takes_a_file_in_parts_and_verifies_it(site, put):
    kept = site.places.files / hashlib.sha256(TRACE).hexdigest()
    kept.write_bytes(b"damaged")  # it gives way to the good one
    assert [put(0, b""), put(0, TRACE[:500]), put(0, b"again")] == [0, 500, 500]
    assert put(500, TRACE[500:]) == put(0, b"") == len(TRACE)
    assert (kept.read_bytes(), kept.stat().st_mode & 0o777) == (TRACE, 0o400)


def test_a_file_that_is_another_one_is_never_kept(site, put):
    assert put(0, b"x" * len(TRACE)) == 0
    with pytest.raises(Refused, match="more bytes"):
        put(0, TRACE + b"!")
    assert list(site.places.files.iterdir()) == site.incoming() == []


def test_only_traces_are_larger_than_files_may_be(site):
    with pytest.raises(Refused, match="at most 67108864 bytes"):
        site.intake.put(site.reader, other_file(1, size=2**27))
    assert site.take(0, TRACE[:400], size=2**27) == 400


@pytest.fixture
def two(site, monkeypatch):
    """Two files on their way, where no more may be."""
    monkeypatch.setattr(_uploads, "_MOST_UPLOADS", 2)
    for number in (1, 2):
        site.intake.put(site.reader, other_file(number))
        site.leave_idle()
    return site


def leave_busy(site):
    for path in site.places.incoming.iterdir():
        path.touch()


def test_uploads_are_bounded_in_number(two):
    leave_busy(two)
    with pytest.raises(Unavailable, match="2 uploads are in progress"):
        two.take(0, TRACE)
    assert two.intake.put(two.reader, other_file(2, offset=5, data=b"on")).count == 7


def test_the_oldest_upload_nobody_goes_on_with_gives_way(two):
    assert two.intake.put(two.reader, other_file(3)).count == 5
    assert [path.name[63] for path in sorted(two.places.incoming.iterdir())] == ["2", "3"]
    assert two.intake.put(two.reader, other_file(1, data=b"")).count == 0


def test_a_lease_has_one_upload(site):
    site.take(0, TRACE[:400])
    site.take(0, b"another", sha256="0" * 64)
    assert [path.name[-69:-5] for path in site.places.incoming.iterdir()] == ["0" * 64]


def test_a_full_disk_makes_uploads_wait(site, monkeypatch):
    monkeypatch.setattr(StatePaths, "disk_shortage", lambda _: "the disk is full")
    with pytest.raises(Unavailable, match="the disk is full"):
        site.take(0, TRACE)
    monkeypatch.undo()
    assert site.take(0, TRACE) == 1000
