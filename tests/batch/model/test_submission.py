"""A campaign in one form: what its runs share is there once."""

from dataclasses import replace

import pytest

from daemon.batch.ledger import LedgerReader, LedgerWriter, connect
from daemon.batch.paths import StatePaths
from daemon.campaign import expand, load_campaign
from daemon.model.messages import LARGEST_SUBMISSION
from daemon.model.submission import CampaignOrigin, CellRun, Submission
from grammars.text import codec


@pytest.fixture(scope="module")
def submission(campaigns):
    """Systems under test of several kinds, doors that differ from repeat to repeat."""
    return expand(load_campaign(campaigns / "demo" / "campaign.yaml"))


def test_on_the_bus_nothing_of_it_is_lost(submission):
    spare = replace(submission, runs=submission.runs[:1], reserve=submission.runs[1:])
    for one in (submission, spare):
        assert codec.from_json(Submission, codec.to_json(one)) == one


def test_from_another_commit_it_is_the_same_submission(submission):
    there = replace(submission, origin=CampaignOrigin("c.yaml", "0" * 64, 3, "f" * 40, "main"))
    assert there.digest == submission.digest
    assert replace(there, about="another").digest != submission.digest


def test_digests_are_those_of_runs_that_are_written_out(submission):
    odd = replace(submission.cells[0], scenario='S "1" ä', limit=1e-7)
    runs = (CellRun(0, 0, 3, 2**63), *submission.runs)
    for one in (submission, replace(submission, cells=(odd, *submission.cells[1:]), runs=runs)):
        assert one.digests == tuple(spec.digest for spec in one.specs)
        assert Submission.of("c", one.specs, ()).digests == one.digests
        assert len(set(one.digests)) == len(one.runs)


def test_cells_and_scripts_are_there_once(submission):
    names = {(spec.scenario, spec.sut.name) for spec in submission.specs}
    assert len(submission.cells) == len(names)
    scripts = [codec.digest(list(script)) for script in submission.scripts]
    assert len(set(scripts)) == len(scripts)
    assert {run.script for run in submission.runs} == set(range(len(scripts)))


def test_a_hundred_thousand_runs_fit_into_one_submission(submission):
    shared = len(codec.to_json(replace(submission, runs=())))
    per_run = (len(codec.to_json(submission)) - shared) / len(submission.runs)
    assert shared + 100_000 * (per_run + len("99999")) < LARGEST_SUBMISSION


def test_the_ledger_gives_back_what_was_submitted(submission, tmp_path):
    db = connect(tmp_path / "ledger.db")
    book, reader = LedgerWriter(db), LedgerReader(db, StatePaths(tmp_path))
    book.submit(submission, 1.0)
    leased = {lease.run: lease.spec for lease in book.lease("w", 1000, 2.0)}
    name, specs = submission.campaign, submission.specs
    assert leased == {f"{name}.{i}": spec for i, spec in enumerate(specs)}
    assert reader.run(f"{name}.3").spec == specs[3]
    db.close()
