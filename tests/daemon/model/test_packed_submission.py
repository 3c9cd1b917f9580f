"""What runs share travels and is kept once; nobody can tell afterwards."""

from dataclasses import replace

import pytest

from daemon.batch.ledger import LedgerReader, LedgerWriter, connect
from daemon.batch.paths import StatePaths
from daemon.campaign import expand, load_campaign
from daemon.model.messages import LARGEST_SUBMISSION
from daemon.model.packed_submission import (
    PackedSubmission,
    pack_submission,
    submission_digest,
)
from daemon.model.status import CampaignOrigin
from grammars.text import codec
from tests.daemon.batch.samples import make_spec, submission_of


@pytest.fixture(scope="module")
def submission(campaigns):
    """Systems under test of several kinds, doors that differ from repeat to repeat."""
    return expand(load_campaign(campaigns / "demo" / "campaign.yaml"))


def test_on_the_bus_nothing_of_it_is_lost(submission):
    spare = replace(submission, runs=submission.runs[:1], reserve=submission.runs[1:])
    for one in (submission, spare):
        travelled = codec.from_json(PackedSubmission, codec.to_json(pack_submission(one)))
        assert submission_digest(travelled) == written_digest(one)


def written_digest(submission):
    """The digest of a submission written out, without where it was written."""
    plain = codec.to_plain(submission)
    del plain["origin"]
    return codec.digest(plain)


def test_from_another_commit_it_is_the_same_submission(submission):
    there = replace(submission, origin=CampaignOrigin("c.yaml", "0" * 64, 3, "f" * 40, "main"))
    packed = codec.from_json(PackedSubmission, codec.to_json(pack_submission(there)))
    assert packed.origin == there.origin
    assert submission_digest(packed) == submission_digest(pack_submission(submission))


def test_digests_are_those_of_what_is_written_out(submission):
    odd = replace(submission.runs[0], scenario='S "1" ä', limit=1e-7, seed=2**63, behaviours=())
    for one in (submission, replace(submission, runs=(odd,), reserve=submission.runs[:2])):
        told = []
        packed = pack_submission(one)
        found = submission_digest(packed, lambda *pair, to=told: to.append(pair))
        assert found == submission_digest(packed) == written_digest(one)
        digests = [digest for _, digest in told]
        assert digests == [run.digest for run in one.runs]


def test_equal_parts_are_there_once_whoever_made_them():
    specs = [make_spec(repeat) for repeat in range(50)]
    packed_form = pack_submission(submission_of("c", *specs))
    assert (len(packed_form.cells), len(packed_form.scripts), len(packed_form.runs)) == (1, 1, 50)


def test_a_hundred_thousand_runs_fit_into_one_submission(submission):
    runs = len(submission.runs)
    per_run = (len(codec.to_json(pack_submission(_repeated(submission, 20)))) - 50_000) / (
        20 * runs
    )
    assert 100_000 * per_run < LARGEST_SUBMISSION


def _repeated(submission, times):
    runs = tuple(
        replace(run, repeat=k, seed=run.seed - k) for k in range(times) for run in submission.runs
    )
    return replace(submission, runs=runs)


@pytest.mark.parametrize("packed", [(9, 0, 0, 0), (0, 9, 0, 0)])
def test_a_number_for_nothing_is_refused(packed):
    packed_form = pack_submission(submission_of("c", make_spec()))
    text = codec.to_json(packed_form).replace(b"[0,0,0,0]", str(list(packed)).encode())
    with pytest.raises(ValueError, match="no cell"):
        submission_digest(codec.from_json(PackedSubmission, text))


def test_the_ledger_gives_back_what_was_submitted(submission, tmp_path):
    db = connect(tmp_path / "ledger.db")
    book, reader = LedgerWriter(db), LedgerReader(db, StatePaths(tmp_path))
    book.submit(submission, 1.0)
    granted = {grant.run: grant.spec for grant in book.lease("w", 1000, 2.0)}
    name = submission.campaign
    assert granted == {f"{name}.{i}": run for i, run in enumerate(submission.runs)}
    assert reader.run(f"{name}.3").spec == submission.runs[3]
    parts = db.execute("SELECT count(*) FROM part").fetchone()[0]
    assert parts < len(submission.runs)
    db.close()
