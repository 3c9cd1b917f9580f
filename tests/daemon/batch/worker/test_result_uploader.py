"""How a worker sends a trace: part by part, over breaks and faults, beside all the rest."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, field
from typing import Any

import pytest

from daemon.batch.errors import Refused, Rejected, Unavailable, Unreachable
from daemon.batch.paths import StatePaths
from daemon.batch.run_process import RESULT, TRACE
from daemon.batch.stores import decode_chunk, encode_chunk
from daemon.batch.worker import Attempt, ResultUploader, WorkerPaths
from daemon.batch.worker._uploader import TracePlacement
from daemon.model import verbs
from daemon.model.messages import (
    CHUNK,
    Lease,
    LedgerAcknowledgement,
    LedgerAnswer,
    UploadProgress,
)
from daemon.model.spec import TraceInfo
from grammars.text import codec
from tests.daemon.batch.harness import eventually
from tests.daemon.batch.samples import make_result, make_spec

DATA = bytes(range(256)) * 4096


@dataclass
class Daemon:
    """What the daemon answers; ``faults`` are raised, or answered, first."""

    arrived: bytes = b""
    faults: list[Any] = field(default_factory=list)
    answers: list[LedgerAnswer] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)
    completions: list[Any] = field(default_factory=list)

    def ask(self, verb, request):
        if verb is verbs.COMPLETE:
            self.completions.append(request)
            return LedgerAcknowledgement(
                self.answers.pop(0) if self.answers else LedgerAnswer.RECORDED
            )
        return self._receive(request)

    def _receive(self, chunk):
        if self.faults:
            fault = self.faults.pop(0)
            if isinstance(fault, UploadProgress):
                return fault
            raise fault
        if chunk.offset == len(self.arrived):
            self.arrived += decode_chunk(chunk.data, chunk.digest)
            self.sizes.append(len(chunk.data))
        return UploadProgress(len(self.arrived), complete=len(self.arrived) == chunk.size)


@pytest.fixture
def daemon():
    return Daemon()


@pytest.fixture
def attempt(tmp_path):
    """A finished attempt in the spool."""
    spec = make_spec()
    (tmp_path / TRACE).write_bytes(DATA)
    info = TraceInfo(hashlib.sha256(DATA).hexdigest(), len(DATA), 1)
    (tmp_path / RESULT).write_bytes(codec.to_json(make_result(spec, trace=info)))
    return Attempt(Lease("c.0", "c", 1, 7, "c/S1.pilot.0.mcap", spec), tmp_path)


@pytest.fixture
def uploader(daemon, tmp_path):
    return uploader_of(daemon, tmp_path)


def uploader_of(daemon, folder, **options):
    paths = WorkerPaths(StatePaths(folder / "own"), shared=False)
    return ResultUploader(daemon, "w", paths, lambda _: None, **options)


def delivered(uploader, attempt):
    return lambda: uploader.deliver(attempt)


def test_a_trace_travels_in_parts_of_one_size(uploader, daemon, attempt):
    eventually(delivered(uploader, attempt))
    assert daemon.arrived == DATA
    whole = len(DATA) // CHUNK
    assert [size for size in daemon.sizes if size] == [len(encode_chunk(bytes(CHUNK))[0])] * whole
    assert uploader.moved == len(DATA)
    (completion,) = daemon.completions
    assert (completion.token, completion.uploaded) == (7, True)


def test_a_break_costs_a_question(uploader, daemon, attempt):
    daemon.arrived = DATA[:100_000]  # of before
    daemon.faults = [Unreachable("gone")]
    with pytest.raises(Unreachable):
        uploader.deliver(attempt)
    eventually(delivered(uploader, attempt))
    assert daemon.arrived == DATA


def test_faults_on_the_way_are_not_for_ever(uploader, daemon, attempt):
    daemon.faults = [UploadProgress(0, complete=False, problem="the chunk is damaged")] * 5
    with pytest.raises(OSError, match="does not arrive: the chunk is damaged"):
        eventually(delivered(uploader, attempt))
    eventually(delivered(uploader, attempt))
    assert daemon.arrived == DATA


def test_a_daemon_without_room_is_asked_again_later(uploader, daemon, attempt):
    """It has answered: that says nothing about the way there."""
    daemon.faults = [Unavailable("the disk is full")]
    with pytest.raises(Unavailable, match="the disk is full"):
        uploader.deliver(attempt)
    eventually(delivered(uploader, attempt))


def test_a_stale_lease_ends_it(uploader, daemon, attempt):
    daemon.faults = [Refused("the lease 7 of c.0 is stale")]
    with pytest.raises(Refused):
        uploader.deliver(attempt)


def test_a_trace_the_daemon_has_lost_is_sent_again(uploader, daemon, attempt):
    daemon.answers = [LedgerAnswer.MISSING]
    assert not uploader.deliver(attempt)
    daemon.arrived = b""
    eventually(delivered(uploader, attempt))
    assert daemon.arrived == DATA
    assert len(daemon.completions) == 2


def test_a_trace_damaged_in_the_spool_is_never_sent(uploader, daemon, attempt):
    (attempt.folder / TRACE).write_bytes(DATA[:-1])
    with pytest.raises(Rejected, match="damaged in the spool"):
        uploader.deliver(attempt)
    (attempt.folder / TRACE).unlink()
    with pytest.raises(Rejected, match="gone"):
        uploader.deliver(attempt)
    assert not daemon.arrived


def test_a_slow_link_leaves_time_for_everything_else(daemon, attempt, tmp_path):
    uploader = uploader_of(daemon, tmp_path, turn=0.0)
    turns = 1
    while not uploader.deliver(attempt):
        turns += 1
    assert turns > 3
    assert daemon.arrived == DATA


def placement_of(folder, name, target, data=DATA):
    source = folder / name
    source.write_bytes(data)
    return TracePlacement(source, target, hashlib.sha256(data).hexdigest())


def test_of_two_workers_at_one_run_the_first_trace_stays(tmp_path, monkeypatch):
    """Also when both have seen nothing there."""
    target = tmp_path / "traces" / "c.mcap"
    target.parent.mkdir()
    first = placement_of(tmp_path, "first", target)
    second = placement_of(tmp_path, "second", target, DATA[:-1])
    link = os.link

    def late_link(*paths):
        """The first comes between the look of the second and what it does."""
        monkeypatch.undo()
        assert first.put()
        link(*paths)

    monkeypatch.setattr(os, "link", late_link)
    assert not second.put()
    second.withdraw()
    assert target.read_bytes() == DATA


def test_who_withdraws_leaves_the_same_trace_of_another_attempt(tmp_path):
    target = tmp_path / "traces" / "c.mcap"
    target.parent.mkdir()
    first, second = (placement_of(tmp_path, name, target) for name in ("first", "second"))
    assert first.put()
    assert second.put()
    first.withdraw()
    assert target.read_bytes() == DATA
    second.withdraw()
    assert not target.exists()
