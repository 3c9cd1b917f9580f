"""An empty state directory; one ledger with both its sides, whose only worker is the test."""

from collections import Counter
from dataclasses import replace

import pytest

from daemon.batch.ledger import LedgerReader, LedgerWriter, check_integrity, connect
from daemon.batch.paths import StatePaths
from daemon.model.messages import Completion, LeaseRef, ReleaseRequest, RetryRequest, SteerRequest
from tests.batch.ledger_rules import broken_rules
from tests.make import (
    make_extension,
    make_result,
    make_search,
    make_spec,
    make_submission,
    submission_of,
)

NOW = 1_000_000.0


class Ledger:
    """A ledger, written and read, at one moment unless another is said."""

    def __init__(self, places, db, reader):
        self.places, self.db, self.reader = places, db, reader
        self.book = LedgerWriter(db, paths=places)

    # --- what clients do

    def submit(self, campaign, *runs, reserve=(), fresh=False, at=NOW, **changes):
        """Enter a campaign of specifications, or of a number of repeats."""
        if runs and isinstance(runs[0], int):
            submission = make_submission(campaign, runs[0])
        else:
            submission = submission_of(campaign, *(runs or [make_spec()]), reserve=reserve)
        return self.book.submit(replace(submission, fresh=fresh, **changes), at)

    def search(self, campaign="s", proposals=0, **changes):
        self.book.begin_search(make_search(campaign, **changes), NOW)
        if proposals:
            more = make_extension(campaign, 0, proposals)
            self.book.extend(more.proposals, more.runs, NOW)

    def retry(self, campaign, *only, at=NOW):
        return self.book.retry(RetryRequest(campaign, only), at)

    def steer(self, campaign, **how):
        return self.book.steer(SteerRequest(campaign, **how), NOW)

    # --- what a worker does

    def lease(self, count=100, worker="w", at=NOW, **more):
        return self.book.lease(worker, count, at, **more)

    def leased(self, count=100):
        return [grant.run for grant in self.lease(count)]

    def renew(self, *grants, worker="w", at=NOW):
        return self.book.renew(worker, refs(*grants), at)

    def complete(self, grant, result=None, worker="w", at=NOW):
        result = result or make_result(grant.spec)
        done = Completion(worker, grant.run, grant.attempt, grant.token, result)
        return self.book.complete(done, at)

    def release(self, grant, reason="why", *, blame=False, died=False, worker="w"):
        request = ReleaseRequest(worker, grant.run, grant.token, reason, blame, died=died)
        return self.book.release(request, NOW)

    def lapse(self, at=NOW + 100.0):
        self.book.lapse(self.book.leases(), at)

    def work(self, make=make_result, count=100, at=NOW, trace=b""):
        """Execute what is queued, each run with a trace; returns the answers."""
        answers = []
        while grants := self.lease(count, at=at):
            for grant in grants:
                path = self.places.trace(grant.trace)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(trace or grant.run.encode())
                answers.append(self.complete(grant, make(grant.spec), at=at))
            if count < 100:
                break
        return answers

    # --- what there is

    def row(self, campaign):
        return self.reader.campaign(campaign)

    def rows(self, campaign, **how):
        return self.reader.runs(campaign, **how).rows

    def count(self, table):
        return self.db.execute(f"SELECT count(*) FROM {table}").fetchone()[0]

    def happened(self, kind):
        """The states of the events of a kind, in order."""
        return [event.state for event in self.book.events if event.kind == kind]

    def traces(self):
        """How many traces campaigns have."""
        return dict(Counter(path.parent.name for path in self.places.traces.glob("*/*.mcap")))

    def assert_sound(self):
        assert check_integrity(self.places.ledger).damage == ()
        assert broken_rules(self.places.ledger) == []


def refs(*grants):
    return tuple(LeaseRef(grant.run, grant.token) for grant in grants)


@pytest.fixture
def ledger(tmp_path):
    places = StatePaths(tmp_path)
    places.make_folders()
    db = connect(places.ledger)
    db.execute("PRAGMA synchronous = OFF")  # power cuts are tested elsewhere
    with LedgerReader.open(places) as reader:
        yield Ledger(places, db, reader)
    db.close()


@pytest.fixture
def places(tmp_path):
    """An empty state directory."""
    places = StatePaths(tmp_path / "state")
    places.make_folders()
    return places
