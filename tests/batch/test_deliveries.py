"""Results on their way from a worker: the trace first, part by part over breaks, or by a link."""

import hashlib
import os
import time
from contextlib import closing

import pytest

from daemon.batch import bus
from daemon.batch.errors import Failed, OtherLedger, Refused, Rejected, Unavailable, Unreachable
from daemon.batch.paths import StatePaths
from daemon.batch.run_process import RESULT, TRACE
from daemon.batch.worker._attempts import Spool
from daemon.batch.worker._connection import DaemonConnection, WorkerPaths
from daemon.batch.worker._deliveries import Deliveries, WorkerTrouble
from daemon.batch.worker._wakeups import BackgroundAsks
from daemon.model import verbs
from daemon.model.messages import (
    PART,
    Count,
    Lease,
    LeaseRef,
    LedgerAcknowledgement,
    LedgerAnswer,
    Rejection,
)
from daemon.model.spec import TraceInfo
from grammars.text import codec
from tests.make import make_result, make_spec

DATA = bytes(range(256)) * 4096


class Daemon:
    """What the daemon answers; ``faults`` are raised, or answered, first."""

    def __init__(self):
        self.arrived = b""
        self.faults, self.answers, self.sizes, self.completions = [], [], [], []

    def ask(self, verb, request):
        if verb is verbs.PUT:
            return Count(self._receive(request))
        if verb is verbs.RELEASE:
            return LedgerAcknowledgement(LedgerAnswer.DONE)
        self.completions.append(request)
        answer = self.answers.pop(0) if self.answers else LedgerAnswer.RECORDED
        if isinstance(answer, Exception):
            raise answer
        return LedgerAcknowledgement(answer)

    def _receive(self, request):
        assert request.lease == LeaseRef("c.0", 7)
        if self.faults:
            fault = self.faults.pop(0)
            if isinstance(fault, int):
                return fault
            raise fault
        if request.offset == len(self.arrived):
            self.arrived += request.data
            self.sizes.append(len(request.data))
        return len(self.arrived)


class Site:
    """A worker with a finished attempt in its spool."""

    def __init__(self, folder, *, shared):
        self.daemon = Daemon()
        self.paths = StatePaths(folder)
        self.paths.make_folders()
        self.asks, self.uploads = BackgroundAsks(), BackgroundAsks()
        self.spool, self.trouble = Spool(self.paths, "w"), WorkerTrouble(int)
        paths, asks = WorkerPaths(self.paths, shared), (self.asks, self.uploads)
        self.deliveries = Deliveries(self.daemon, paths, *asks, self.spool, self.trouble, "w")
        spec = make_spec()
        self.attempt = self.spool.open(Lease("c.0", "c", 1, 7, "c/S1.pilot.0.mcap", spec))
        self.trace = self.attempt.folder / TRACE
        self.trace.write_bytes(DATA)
        info = TraceInfo(hashlib.sha256(DATA).hexdigest(), len(DATA), 1)
        result = make_result(spec, trace=info)
        (self.attempt.folder / RESULT).write_bytes(codec.to_json(result))
        self.left = self.paths.uploaded_trace("c.0", 7, info.sha256)
        self.deliveries.finished.append(self.attempt)

    def close(self):
        for resource in (self.asks, self.uploads, self.spool):
            resource.close()

    def step(self):
        """Ask what is to be asked, and take the answers."""
        self.deliveries.send_results()
        for asks in (self.asks, self.uploads):
            asks.wait(30.0)
            for folder, answer in asks.take():
                self.deliveries.take_result_answer(folder, answer)

    def deliver(self):
        """Go on until it is delivered."""
        for _ in range(10):
            self.step()
            if not self.deliveries.finished:
                return
        raise AssertionError(self.trouble.words)


@pytest.fixture
def site(tmp_path):
    with closing(Site(tmp_path, shared=False)) as site:
        yield site


@pytest.fixture
def local(tmp_path):
    """On the daemon's own file system."""
    with closing(Site(tmp_path, shared=True)) as site:
        yield site


def test_a_trace_travels_in_parts_of_one_size_before_its_result(site):
    site.step()
    assert site.daemon.arrived == DATA
    assert site.daemon.sizes == [0] + [PART] * (len(DATA) // PART)
    assert site.daemon.completions == []
    site.step()
    assert [completion.token for completion in site.daemon.completions] == [7]
    assert site.deliveries.moved == len(DATA)
    assert not site.attempt.folder.exists()


def test_what_is_large_may_take_longer_than_a_question_usually_may(monkeypatch):
    """Results, and parts of files; over a slow line."""
    monkeypatch.setattr(bus, "ask", lambda _, where, verb, request, timeout, holder: timeout)
    daemon = DaemonConnection(None, "the daemon")
    limits = {verb: daemon.ask(verb, None) for verb in verbs.VERBS.values()}
    usual = limits[verbs.RENEW]
    longer = {verb for verb, limit in limits.items() if limit > usual}
    assert longer == {verbs.GET, verbs.PUT, verbs.COMPLETE}


def test_after_a_break_it_goes_on_where_it_was(site):
    site.daemon.faults = [0, Unreachable("gone")]
    with pytest.raises(Unreachable):
        site.step()
    site.daemon.arrived = DATA[:100_000]  # of which the acknowledgement was lost
    site.deliver()
    assert site.daemon.arrived == DATA
    assert site.daemon.sizes[1] == PART


def test_parts_that_are_not_taken_are_not_sent_for_ever(site):
    site.daemon.faults = [0] * 6
    site.step()
    assert "does not arrive: 5 parts of it were refused" in site.trouble.words
    site.deliver()
    assert site.daemon.arrived == DATA


@pytest.mark.parametrize(
    "fault", [Unavailable("the disk is full"), Failed("nobody thought of that"), Refused("no")]
)
def test_a_daemon_that_does_not_take_it_is_asked_again_later(site, fault):
    site.daemon.faults = [fault]
    site.daemon.answers = [fault]
    site.step()
    assert str(fault) in site.trouble.words
    assert site.attempt.folder.exists()
    site.deliver()
    assert len(site.daemon.completions) == 2
    assert site.trouble.words == ""


def test_a_trace_the_daemon_has_lost_is_sent_again(site):
    site.daemon.answers = [LedgerAnswer.MISSING]
    site.step()
    site.step()
    assert "does not find the trace of c.0" in site.trouble.words
    site.daemon.arrived = b""
    site.deliver()
    assert site.daemon.arrived == DATA
    assert len(site.daemon.completions) == 2


@pytest.mark.parametrize("where", ["site", "local"])
@pytest.mark.parametrize("damage", [lambda t: t.write_bytes(DATA[:-1]), lambda t: t.unlink()])
def test_a_trace_damaged_in_the_spool_is_neither_sent_nor_left(request, where, damage):
    site = request.getfixturevalue(where)
    damage(site.trace)
    site.deliver()
    (release,) = site.deliveries.releases
    assert "the spool" in release.reason
    assert not release.blame
    assert (site.daemon.arrived, site.left.exists()) == (b"", False)


def test_a_trace_that_cannot_be_read_now_is_kept(site, monkeypatch):
    monkeypatch.setattr("daemon.batch.worker._deliveries.file_sha256", fail)
    site.step()
    assert "Input/output error" in site.trouble.words
    monkeypatch.undo()
    site.deliver()
    assert site.daemon.arrived == DATA


def fail(*_):
    raise OSError(5, "Input/output error")


def test_on_the_daemons_file_system_the_trace_lies_there_before_the_result(local):
    local.daemon.answers = [Unavailable("busy")]
    local.step()
    assert local.left.samefile(local.trace)
    local.deliver()
    assert local.daemon.sizes == []
    assert len(local.daemon.completions) == 2
    assert local.left.read_bytes() == DATA


def test_a_trace_that_waited_for_long_is_no_stray_where_it_is_left(local):
    os.utime(local.trace, (0, 0))
    local.deliver()
    assert time.time() - local.left.stat().st_mtime < 3600.0


def test_it_is_left_there_again_when_it_is_gone(local):
    local.daemon.answers = [LedgerAnswer.MISSING]
    local.step()
    local.left.unlink()
    local.deliver()
    assert local.left.read_bytes() == DATA


def test_without_hard_links_it_is_copied(local, monkeypatch):
    monkeypatch.setattr("os.link", fail)
    local.deliver()
    assert local.left.read_bytes() == DATA


def test_only_a_rejection_ends_it(local):
    local.daemon.answers = [Rejected("there is no run c.0", Rejection.UNKNOWN_RUN)]
    local.deliver()
    assert [release.run for release in local.deliveries.releases] == ["c.0"]
    assert not local.attempt.folder.exists()


def test_what_is_of_another_ledger_waits_for_it(site):
    site.daemon.answers = [OtherLedger("another")]
    site.deliver()
    assert "1 finished runs wait" in site.deliveries.foreign_words
    assert (site.attempt.folder.exists(), site.trouble.words) == (True, "")
    site.deliveries.offer_again()
    site.deliver()
    assert (site.attempt.folder.exists(), site.deliveries.foreign_words) == (False, "")


# --- pauses after trouble, and questions in the background


def test_pauses_double_until_a_success(monkeypatch):
    now = 100.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    trouble, whole = WorkerTrouble(int), 1.0
    for _ in range(12):
        trouble.note("the disk is full")
        assert 0.75 * whole <= trouble.until - now <= 1.25 * whole
        until = trouble.until
        trouble.note("the disk is full")  # of what had begun before the pause
        assert trouble.until == until
        now, whole = until, min(2.0 * whole, 60.0)
    trouble.clear()
    assert (trouble.words, trouble.until) == ("", 0.0)
    trouble.note("no process")
    assert trouble.until - now <= 1.25


def test_answers_are_taken_once_and_wake_the_loop():
    with closing(BackgroundAsks()) as asks:
        asks.start("one", lambda: 1)
        asks.start("two", lambda: 1 // 0)
        assert ("one" in asks, len(asks)) == (True, 2)
        asks.wait()
        (_, good), (_, bad) = asks.take()
        assert good.result() == 1
        with pytest.raises(ZeroDivisionError):
            bad.result()
        assert (asks.take(), len(asks)) == ([], 0)
