"""What the daemon makes of parts of traces, without a bus: in order, damaged, hostile, stale."""

from __future__ import annotations

import hashlib
import os
import random
import time
from dataclasses import dataclass, replace

import pytest

from daemon.batch.errors import Refused, Unavailable
from daemon.batch.ledger import LedgerReader, LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.batch.server import EventLog, TraceUploads
from daemon.batch.stores import encode_chunk
from daemon.model.messages import (
    Completion,
    Lease,
    LedgerAnswer,
    RetryRequest,
    TraceUploadChunk,
    UploadProgress,
)
from daemon.model.spec import TraceInfo
from daemon.model.verdicts import Outcome
from grammars.text import codec
from tests.daemon.batch.samples import make_result, make_submission

NOW = 1e9
TRACE = random.Random(1).randbytes(1000)


@dataclass
class Site:
    """A ledger with one leased run, and the intake beside it."""

    places: StatePaths
    book: LedgerWriter
    reader: LedgerReader
    intake: TraceUploads
    journal: EventLog
    grant: Lease

    def chunk(self, offset, part, **changes):
        sha256 = hashlib.sha256(TRACE).hexdigest()
        ours = ("w", self.grant.run, self.grant.token, sha256, len(TRACE))
        made = TraceUploadChunk(*ours, offset, era=self.grant.era)
        text, digest = encode_chunk(part)
        return replace(made, **({"data": text, "digest": digest} | changes))

    def take(self, offset, part, **changes):
        return self.intake.add_chunk(self.reader, self.chunk(offset, part, **changes))

    def completion(self, data=TRACE, **changes):
        info = TraceInfo(hashlib.sha256(data).hexdigest(), len(data), 1)
        result = make_result(self.grant.spec, trace=info)
        made = Completion("w", self.grant.run, 1, self.grant.token, result, uploaded=True)
        return replace(made, **changes)

    def complete(self, completion):
        """What the daemon does with a completion."""
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
def site(tmp_path):
    places = StatePaths(tmp_path)
    places.make_folders()
    journal = EventLog(places.log)
    with LedgerWriter.open(places) as book, LedgerReader.open(places) as reader:
        book.begin_era()
        book.submit(make_submission("c", 1), NOW)
        (grant,) = book.lease("w", 1, NOW)
        yield Site(places, book, reader, TraceUploads(places, journal), journal, grant)
    journal.close()


def test_a_trace_arrives_in_parts_and_gets_its_name_with_the_result(site):
    assert site.take(0, b"") == UploadProgress(0, complete=False)
    assert site.take(0, TRACE[:400]) == UploadProgress(400, complete=False)
    assert site.take(400, TRACE[400:]) == UploadProgress(1000, complete=True)
    assert not site.trace.exists()
    assert site.complete(site.completion()) is LedgerAnswer.RECORDED
    assert site.trace.read_bytes() == TRACE
    assert site.incoming() == []


def test_another_daemon_goes_on_where_the_first_one_was(site):
    site.take(0, TRACE[:400])
    site.intake = TraceUploads(site.places, site.journal)
    assert site.take(0, b"") == UploadProgress(400, complete=False)
    assert site.take(400, TRACE[400:]).complete
    site.intake = TraceUploads(site.places, site.journal)
    assert site.take(0, b"").complete


def test_a_part_that_does_not_continue_changes_nothing(site):
    site.take(0, TRACE[:400])
    for offset in (0, 399, 401, 2**50):
        received = site.take(offset, TRACE[:100])
        assert (received.offset, received.complete) == (400, False)
        assert "expected is 400" in received.problem


@pytest.mark.parametrize(
    "changes", [{"digest": "0" * 64}, {"data": "bm90aGluZw=="}, {"data": "not base64!"}]
)
def test_a_damaged_part_is_sent_again(site, changes):
    received = site.take(0, TRACE[:400], **changes)
    assert (received.offset, received.complete) == (0, False)
    assert "damaged" in received.problem
    assert site.take(0, TRACE).complete


def test_a_whole_that_is_another_one_begins_again(site):
    received = site.take(0, TRACE[:-1] + b"!")
    assert (received.offset, received.complete) == (0, False)
    assert "another digest" in received.problem
    assert site.incoming() == []
    assert site.take(0, TRACE).complete


def test_a_result_without_its_trace_is_not_recorded(site):
    assert site.complete(site.completion()) is LedgerAnswer.MISSING
    assert site.complete(site.completion(uploaded=False)) is LedgerAnswer.MISSING
    site.take(0, TRACE[:400])
    assert site.complete(site.completion()) is LedgerAnswer.MISSING
    assert site.book.awaits_result("c.0", site.grant.token)


def test_more_than_announced_is_refused(site):
    with pytest.raises(Refused, match="more bytes than the 1000 announced"):
        site.take(0, TRACE + b"!")


def test_whoever_was_ever_leased_the_run_may_send(site):
    """Late or not, while there is no result; the parts of two do not get into each other's way."""
    for token in (0, site.grant.token + 1):
        with pytest.raises(Refused, match="never leased"):
            site.take(0, TRACE[:400], token=token)
    site.take(0, TRACE[:400])
    site.book.lapse(site.book.leases(), NOW + 1000.0)
    (again,) = site.book.lease("v", 1, NOW + 2000.0)
    assert site.take(0, TRACE[:300], token=again.token).offset == 300
    assert site.take(400, TRACE[400:]).complete
    assert site.incoming() == [".mcap", ".part"]
    assert site.complete(site.completion()) is LedgerAnswer.RECORDED
    assert site.trace.read_bytes() == TRACE
    assert site.incoming() == []
    # What the other one has is not needed any more, and its result is compared with the first.
    assert site.take(300, TRACE[300:], token=again.token).complete
    assert site.complete(site.completion(token=again.token)) is LedgerAnswer.KNOWN
    assert site.trace.read_bytes() == TRACE


def test_under_a_lease_that_was_never_given_nothing_is_sent(site):
    with pytest.raises(Refused, match="never leased"):
        site.intake.add_chunk(site.reader, site.chunk(0, TRACE, token=site.grant.token + 1))
    assert site.incoming() == []


def test_what_was_executed_before_another_result_was_asked_for_is_not_needed(site):
    site.take(0, TRACE)
    first = site.completion()
    stopped = replace(first.result, outcome=Outcome.ERROR, stopped=True)
    assert site.complete(replace(first, result=stopped)) is LedgerAnswer.RECORDED
    site.trace.unlink()
    assert site.book.retry(RetryRequest("c", ("error",)), NOW) == 1
    assert site.take(0, TRACE).complete
    assert site.complete(first) is LedgerAnswer.REDUNDANT
    assert site.book.awaits_result("c.0", site.grant.token + 1)
    assert (site.incoming(), site.trace.exists()) == ([], False)


def test_what_is_cancelled_is_not_wanted(site):
    site.take(0, TRACE[:400])
    site.book.cancel("c", NOW)
    assert site.take(400, TRACE[400:]).complete  # nothing is written
    assert site.complete(site.completion()) is LedgerAnswer.DROPPED
    assert site.incoming() == []


def test_a_lost_acknowledgement_costs_no_second_transfer(site):
    site.take(0, TRACE)
    site.complete(site.completion())
    assert site.take(0, b"").complete
    assert site.complete(site.completion()) is LedgerAnswer.KNOWN
    assert site.trace.read_bytes() == TRACE


def test_a_repetition_leaves_the_trace_or_brings_it_back(site):
    site.take(0, TRACE)
    site.complete(site.completion())
    site.book.retry(RetryRequest("c", ("all",)), NOW)
    (site.grant,) = site.book.lease("w", 1, NOW)
    assert site.take(0, b"").complete  # it lies there already
    site.trace.unlink()
    assert site.take(0, b"") == UploadProgress(0, complete=False)
    site.take(0, TRACE)
    assert site.complete(site.completion()) is LedgerAnswer.KNOWN
    assert site.trace.read_bytes() == TRACE


def test_another_result_never_replaces_the_trace_recorded(site):
    site.take(0, TRACE)
    site.complete(site.completion())
    other = site.completion(b"something else")
    assert site.complete(other) is LedgerAnswer.DIFFERS
    assert site.trace.read_bytes() == TRACE


@pytest.mark.parametrize("run", ["../../c.0", "c.0/..", "/etc/passwd", "c", "", "c.0\x00", "d.0"])
def test_names_that_are_none_are_refused(site, run):
    with pytest.raises(Refused):
        site.take(0, TRACE, run=run)
    assert site.incoming() == []


def test_hostile_digests_and_sizes_do_not_pass_the_border(site):
    good = codec.to_plain(site.chunk(0, b"x"))
    for field, value in (
        ("sha256", "../../../etc/passwd"),
        ("sha256", "A" * 64),
        ("size", -1),
        ("size", 2**60),
        ("offset", -1),
        ("data", "A" * (2 * 2**20)),
    ):
        with pytest.raises(ValueError, match=field):
            codec.from_plain(TraceUploadChunk, good | {field: value})


def test_uploads_are_bounded_in_number(site):
    site.intake = TraceUploads(site.places, site.journal, most=2)
    for name in ("a", "b"):
        (site.places.incoming / name).touch()
    with pytest.raises(Unavailable, match="has to wait"):
        site.take(0, TRACE)


def test_a_full_disk_makes_uploads_wait(site, monkeypatch):
    monkeypatch.setattr(StatePaths, "disk_shortage", lambda _: "the disk is full")
    with pytest.raises(Unavailable, match="the disk is full"):
        site.take(0, TRACE)
    monkeypatch.undo()
    assert site.take(0, TRACE).complete


def test_an_upload_nobody_goes_on_with_is_given_up(site):
    site.take(0, TRACE[:400])
    (part,) = site.places.incoming.iterdir()
    long_ago = time.time() - 7200.0
    os.utime(part, (long_ago, long_ago))
    site.intake = TraceUploads(site.places, site.journal)
    assert site.take(0, b"") == UploadProgress(0, complete=False)
    assert site.incoming() == []
