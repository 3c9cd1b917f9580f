"""Whatever happens in whatever order: exactly one result, no lease twice, counts that add up.

Workers are cut off and come back with old leases, bring late results, take over what others left.
The daemon is killed in the middle of a transaction, freezes, and its wall clock is set.
"""

import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from daemon.batch.errors import Refused
from daemon.batch.ledger import LedgerWriter, connect
from daemon.batch.server._workers import LeaseClock, LeaseDeadlines
from daemon.model.messages import (
    Completion,
    LeaseRef,
    LedgerAnswer,
    ReleaseRequest,
    RetryRequest,
)
from daemon.model.spec import TraceInfo
from daemon.model.verdicts import Outcome, RunState
from tests.make import make_result, make_spec, submission_of

WORKERS = st.sampled_from(["w1", "w2", "w3"])
LEASE = 10.0
TICK = 2.0
DAY = 86_400.0
VARYING = "c.2"
"""The run whose system is not repeatable."""


class LedgerMachine(RuleBasedStateMachine):
    @initialize()
    def begin(self):
        self.folder = tempfile.TemporaryDirectory()
        self.now = 1e9
        self.open()
        self.granted = []
        self.first = {}
        self.strikes = Counter()
        self.outdated = Counter()
        specs = [make_spec(i) for i in range(3)]
        specs[2] = replace(specs[2], sut=replace(specs[2].sut, parameters={"repeatable": False}))
        self.submission = submission_of("c", *specs)
        self.book.submit(self.submission, self.now)
        self.acknowledged, self.seen = False, self.rows()

    def open(self):
        """Start a daemon on the ledger: what it had in memory is gone."""
        self.db = connect(Path(self.folder.name) / "ledger.db")
        self.db.execute("PRAGMA synchronous = OFF")  # no power is cut here
        self.book = LedgerWriter(self.db, attempts=3)
        self.clock, self.steady = LeaseClock(TICK), 0.0
        self.deadlines = LeaseDeadlines(LEASE, self.clock)
        self.renewed = {}
        self.tick()

    def tick(self):
        """Let leases lapse that nobody has renewed in time."""
        self.clock.advance(self.steady)
        running = self.book.leases()
        overdue = self.deadlines.overdue(running)
        for lease in running:
            last = self.renewed.setdefault(lease.token, self.clock.now)
            assert (lease in overdue) == (self.clock.now > last + LEASE)
        self.book.lapse(overdue, self.now)

    def teardown(self):
        if hasattr(self, "db"):
            self.db.close()
            self.folder.cleanup()

    @rule(worker=WORKERS, count=st.integers(0, 3))
    def lease(self, worker, count):
        grants = self.book.lease(worker, count, self.now)
        assert len(grants) <= count
        self.granted += [(worker, grant) for grant in grants]

    @precondition(lambda self: self.granted)
    @rule(data=st.data(), variant=st.sampled_from("aaab"))
    def complete(self, data, variant):
        worker, grant = data.draw(st.sampled_from(self.granted))
        outcome = Outcome.PASS if variant == "a" else Outcome.FAIL
        result = make_result(grant.spec, outcome=outcome, trace=TraceInfo(variant * 64, 1, 1))
        before = self.state(grant.run)
        completion = Completion(worker, grant.run, grant.attempt, grant.token, result)
        outdated = grant.token <= self.outdated[grant.run]
        wanted = self.book.awaits_result(grant.run, grant.token)
        answer = self.book.complete(completion, self.now)
        assert wanted == (answer is LedgerAnswer.RECORDED)
        if before is RunState.CANCELLED:
            assert answer is LedgerAnswer.DROPPED
        elif grant.run not in self.first and outdated:
            assert answer is LedgerAnswer.REDUNDANT
        elif grant.run not in self.first:
            assert answer is LedgerAnswer.RECORDED
            self.first[grant.run] = result.digest
        elif self.first[grant.run] == result.digest:
            assert answer is LedgerAnswer.KNOWN
        else:
            varying = grant.run == VARYING
            assert answer is (LedgerAnswer.REDUNDANT if varying else LedgerAnswer.DIFFERS)
        if before is not RunState.CANCELLED:
            # One result ends everything, unless it is of before somebody wanted another one.
            assert self.state(grant.run) is (before if outdated else RunState.DONE)

    @precondition(lambda self: self.granted)
    @rule(data=st.data(), blame=st.booleans())
    def release(self, data, blame):
        worker, grant = data.draw(st.sampled_from(self.granted))
        request = ReleaseRequest(worker, grant.run, grant.token, "why", blame)
        answer = self.book.release(request, self.now)
        self.strikes[grant.run] += blame and answer is LedgerAnswer.DONE

    @rule(worker=WORKERS, honest=st.booleans(), adopts=st.booleans())
    def renew(self, worker, honest, adopts):
        """A worker says what it has: also what lapsed long ago, or what a dead one has left."""
        mine = [
            LeaseRef(g.run, g.token) for w, g in self.granted if honest and (adopts or w == worker)
        ]
        before = {row["id"]: (row["state"], row["token"]) for row in self.rows()}
        self.deadlines.renew(mine)
        self.renewed |= dict.fromkeys((hold.token for hold in mine), self.clock.now)
        gone = set(self.book.renew(worker, mine, self.now))
        for hold in mine:
            over = before[hold.run][0] in ("done", "cancelled")
            assert (hold in gone) == (over or hold.token <= self.outdated[hold.run])
        wanted = {hold.run for hold in mine if hold not in gone}
        for row in self.rows():
            state, token = before[row["id"]]
            if row["id"] in wanted and state == "queued":
                # At work again, without another attempt.
                assert LeaseRef(row["id"], row["token"]) in mine
                assert (row["state"], row["worker"]) == ("running", worker)
            elif state == "running" and row["state"] == "running":
                assert row["token"] == token
        held = {(hold.run, hold.token) for hold in mine}
        for row in self.rows():
            if row["state"] == "running" and row["worker"] == worker:
                assert (row["id"], row["token"]) in held

    @precondition(lambda self: self.granted)
    @rule(data=st.data())
    def invent(self, data):
        """Nothing can be done with a lease that was never given."""
        worker, grant = data.draw(st.sampled_from(self.granted))
        token = data.draw(st.sampled_from([0, -1, grant.token + 10**6]))
        before = list(self.db.iterdump())
        hold = LeaseRef(grant.run, token)
        assert self.book.renew("w4", (hold,), self.now) == (hold,)
        result = make_result(grant.spec)
        completion = Completion(worker, grant.run, grant.attempt, token, result)
        release = ReleaseRequest(worker, grant.run, token, "why", blame=True)
        with pytest.raises(Refused, match="never leased"):
            self.book.complete(completion, self.now)
        with pytest.raises(Refused, match="never leased"):
            self.book.release(release, self.now)
        assert list(self.db.iterdump()) == before

    @rule(ticks=st.sampled_from([1, 3, 7]))
    def time_passes(self, ticks):
        for _ in range(ticks):
            self.steady += TICK
            self.now += TICK
            self.tick()

    @rule(seconds=st.sampled_from([11.0, 300.0]))
    def the_daemon_freezes(self, seconds):
        """No lease lapses for it: renewals that came meanwhile are heard first."""
        self.steady += seconds
        self.now += seconds
        before = self.clock.now
        self.tick()
        assert self.clock.now - before <= 2 * TICK

    @rule(days=st.sampled_from([-400, -0.1, 0.1, 400]))
    def the_clock_is_set(self, days):
        running = self.book.leases()
        self.now += days * DAY
        self.tick()
        assert self.book.leases() == running

    @rule()
    def cancel(self):
        self.book.cancel("c", self.now)
        assert all(row["state"] not in ("queued", "running") for row in self.rows())

    @rule()
    def acknowledge(self):
        bad = sum(
            row["state"] == "lost" or (row["state"], row["outcome"]) == ("done", "fail")
            for row in self.rows()
        )
        assert self.book.acknowledge("c", self.now) == bad
        self.acknowledged = True

    @rule(only=st.sampled_from(["lost", "cancelled", "pass", "fail", "all"]))
    def retry(self, only):
        before = {row["id"]: row for row in self.rows()}
        self.book.retry(RetryRequest("c", (only,)), self.now)
        for row in self.rows():
            old = before[row["id"]]
            if row["state"] == old["state"]:
                continue
            self.strikes[row["id"]] = 0
            if old["state"] == "done":
                self.outdated[row["id"]] = old["granted"]
                if row["id"] == VARYING:
                    del self.first[VARYING]

    @rule(torn=st.booleans(), data=st.data())
    def the_daemon_is_killed(self, torn, data):
        """What was committed is there for the next one, of what was not there is nothing."""
        before = self.rows(), self.book.leases()
        if torn:
            self.db.execute("BEGIN IMMEDIATE")
            grants = self.book.lease("w1", 3, self.now)
            for grant in data.draw(st.sampled_from([(), grants])):
                ours = ("w1", grant.run, grant.attempt, grant.token)
                self.book.complete(Completion(*ours, make_result(grant.spec)), self.now)
        self.db.close()
        self.open()
        assert (self.rows(), self.book.leases()) == before

    def rows(self):
        cursor = self.db.execute("SELECT * FROM run")
        names = [column[0] for column in cursor.description]
        return [dict(zip(names, row, strict=True)) for row in cursor]

    def state(self, run):
        return next(RunState(row["state"]) for row in self.rows() if row["id"] == run)

    @invariant()
    def results_are_the_first_ones(self):
        assert dict(self.db.execute("SELECT run, digest FROM result")) == self.first
        for row in self.rows():
            assert row["result"] == self.first.get(row["id"], "")
            if row["state"] == "done":
                assert row["result"]
            if row["state"] in ("lost", "cancelled"):
                assert not row["result"]

    @invariant()
    def nothing_but_blame_is_a_strike(self):
        assert all(row["strikes"] == self.strikes[row["id"]] for row in self.rows())

    @invariant()
    def tokens_are_never_shared(self):
        tokens = [grant.token for _, grant in self.granted]
        assert len(set(tokens)) == len(tokens)

    @invariant()
    def counts_add_up(self):
        counted = {
            (state, outcome): runs
            for state, outcome, runs in self.db.execute("SELECT state, outcome, runs FROM tally")
            if runs
        }
        assert counted == Counter((row["state"], row["outcome"]) for row in self.rows())

    @invariant()
    def what_is_acknowledged_stays_so_until_there_is_news(self):
        rest = ("done", "lost", "cancelled")
        pairs = tuple(zip(self.seen, self.rows(), strict=True))
        news = (
            any(new["state"] == "lost" != old["state"] for old, new in pairs),
            any(new["outcome"] == "fail" != old["outcome"] for old, new in pairs),
            any(new["nondeterministic"] > old["nondeterministic"] for old, new in pairs),
            any(old["state"] in rest and new["state"] == "queued" for old, new in pairs),
        )
        self.acknowledged, self.seen = self.acknowledged and not any(news), self.rows()
        (acknowledged,) = self.db.execute("SELECT acknowledged FROM campaign").fetchone()
        assert acknowledged == self.acknowledged

    @invariant()
    def a_campaign_is_finished_when_nothing_is_under_way(self):
        waiting = any(row["state"] in ("queued", "running") for row in self.rows())
        at = self.db.execute("SELECT finished_at FROM campaign").fetchone()[0]
        assert (at is None) == waiting


TestLedger = LedgerMachine.TestCase
TestLedger.settings = settings(stateful_step_count=30)
