"""Whatever happens in whatever order: exactly one result, no lease twice, counts that add up."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from daemon.batch.ledger import LedgerWriter, connect
from daemon.model.messages import (
    Completion,
    Lease,
    LeaseRef,
    LedgerAnswer,
    ReleaseRequest,
    RetryRequest,
)
from daemon.model.spec import TraceInfo
from daemon.model.status import RunState
from tests.daemon.batch.samples import make_result, make_submission

WORKERS = st.sampled_from(["w1", "w2"])
LEASE = 10.0


class LedgerMachine(RuleBasedStateMachine):
    @initialize()
    def open(self) -> None:
        self.db = connect(Path(":memory:"))
        self.book = LedgerWriter(self.db, attempts=3, lease=LEASE)
        self.now = 1000.0
        self.granted: list[tuple[str, Lease]] = []
        self.first: dict[str, str] = {}
        self.submission = make_submission("c", 3)
        self.book.submit(self.submission, self.now)

    def teardown(self) -> None:
        if hasattr(self, "db"):
            self.db.close()

    @rule(worker=WORKERS, count=st.integers(0, 3))
    def lease(self, worker: str, count: int) -> None:
        grants = self.book.lease(worker, count, self.now)
        assert len(grants) <= count
        self.granted += [(worker, grant) for grant in grants]

    @precondition(lambda self: self.granted)
    @rule(data=st.data(), variant=st.sampled_from("aaab"))
    def complete(self, data: st.DataObject, variant: str) -> None:
        worker, grant = data.draw(st.sampled_from(self.granted))
        result = make_result(grant.spec, trace=TraceInfo(variant * 64, 1, 1))
        before = self.state(grant.run)
        completion = Completion(worker, grant.run, grant.attempt, grant.token, result)
        answer = self.book.complete(completion, self.now)
        if before is RunState.CANCELLED:
            assert answer is LedgerAnswer.DROPPED
        elif grant.run not in self.first:
            assert answer is LedgerAnswer.RECORDED
            self.first[grant.run] = result.digest
        else:
            same = self.first[grant.run] == result.digest
            assert answer is (LedgerAnswer.KNOWN if same else LedgerAnswer.DIFFERS)

    @precondition(lambda self: self.granted)
    @rule(data=st.data(), blame=st.booleans())
    def release(self, data: st.DataObject, blame: bool) -> None:
        worker, grant = data.draw(st.sampled_from(self.granted))
        self.book.release(ReleaseRequest(worker, grant.run, grant.token, "why", blame), self.now)

    @rule(worker=WORKERS, honest=st.booleans())
    def renew(self, worker: str, honest: bool) -> None:
        mine = [LeaseRef(g.run, g.token) for w, g in self.granted if w == worker]
        held = {(row["id"], row["token"]) for row in self.rows() if row["state"] == "running"}
        gone = self.book.renew(worker, mine if honest else [], self.now)
        if honest:
            assert {(h.run, h.token) for h in gone}.isdisjoint(held)
        else:
            running = [r for r in self.rows() if r["worker"] == worker and r["state"] == "running"]
            assert running == []

    @rule(seconds=st.sampled_from([1.0, 4.0, 11.0]))
    def time_passes(self, seconds: float) -> None:
        self.now += seconds
        self.book.expire_leases(self.now)
        assert all(r["lease_until"] >= self.now for r in self.rows() if r["state"] == "running")

    @rule(worker=WORKERS)
    def worker_goes(self, worker: str) -> None:
        self.book.release_worker(worker, self.now)

    @rule()
    def cancel(self) -> None:
        self.book.cancel("c", self.now)
        assert all(row["state"] not in ("queued", "running") for row in self.rows())

    @rule(only=st.sampled_from(["lost", "cancelled", "pass", "all"]))
    def retry(self, only: str) -> None:
        self.book.retry(RetryRequest("c", (only,)), self.now)

    @rule()
    def restart(self) -> None:
        self.book = LedgerWriter(self.db, attempts=3, lease=LEASE)
        self.book.extend_leases(self.now)

    def rows(self) -> list[dict[str, Any]]:
        cursor = self.db.execute("SELECT * FROM run")
        names = [column[0] for column in cursor.description]
        return [dict(zip(names, row, strict=True)) for row in cursor]

    def state(self, run: str) -> RunState:
        return next(RunState(row["state"]) for row in self.rows() if row["id"] == run)

    @invariant()
    def results_are_the_first_ones(self) -> None:
        if not hasattr(self, "db"):
            return
        assert dict(self.db.execute("SELECT run, digest FROM result")) == self.first
        for row in self.rows():
            assert row["result"] == self.first.get(row["id"], "")
            if row["state"] == "done":
                assert row["result"]
            if row["state"] in ("lost", "cancelled"):
                assert not row["result"]

    @invariant()
    def tokens_are_never_shared(self) -> None:
        if hasattr(self, "db"):
            tokens = [grant.token for _, grant in self.granted]
            assert len(set(tokens)) == len(tokens)

    @invariant()
    def counts_add_up(self) -> None:
        if not hasattr(self, "db"):
            return
        counted = {
            (state, outcome): runs
            for state, outcome, runs in self.db.execute("SELECT state, outcome, runs FROM tally")
            if runs
        }
        assert counted == Counter((row["state"], row["outcome"]) for row in self.rows())

    @invariant()
    def a_campaign_is_finished_when_nothing_is_under_way(self) -> None:
        if not hasattr(self, "db"):
            return
        waiting = any(row["state"] in ("queued", "running") for row in self.rows())
        at = self.db.execute("SELECT finished_at FROM campaign").fetchone()[0]
        assert (at is None) == waiting


TestLedger = LedgerMachine.TestCase
TestLedger.settings = settings(max_examples=60, stateful_step_count=30, deadline=None)
