"""Large results: none is taken, and pages of runs end at their bytes."""

from dataclasses import replace

import pytest

from daemon.batch.errors import Refused
from daemon.batch.ledger import LedgerReader, LedgerWriter, connect
from daemon.batch.paths import StatePaths
from daemon.model.messages import (
    Completion,
)
from daemon.model.spec import LARGEST_RESULT
from daemon.model.verdicts import Evidence
from tests.make import make_result, make_submission

NOW = 1_000_000.0
RUNS = 24


@pytest.fixture
def db(tmp_path):
    writing = connect(tmp_path / "ledger.db")
    yield writing
    writing.close()


@pytest.fixture
def reader(db, tmp_path):
    with LedgerReader.open(StatePaths(tmp_path)) as found:
        yield found


def padded(result, length, copies=1):
    verdict = replace(result.verdicts[0], evidence=Evidence(note="x" * length))
    return replace(result, verdicts=(verdict,) * copies)


def test_a_result_of_too_many_bytes_is_refused(db, reader):
    book = LedgerWriter(db)
    book.submit(make_submission("c", 1), NOW)
    (grant,) = book.lease("w", 1, NOW)
    result = padded(make_result(grant.spec), LARGEST_RESULT)
    completion = Completion("w", grant.run, grant.attempt, grant.token, result)
    with pytest.raises(Refused, match=f"at most {LARGEST_RESULT} are kept"):
        book.complete(completion, NOW)
    assert reader.run(grant.run).row.result is None


@pytest.fixture
def large_results(db):
    """Enter results that are nearly too large, more of them than a page holds."""
    book = LedgerWriter(db)
    book.submit(make_submission("c", RUNS), NOW)
    for grant in book.lease("w", 100, NOW):
        result = padded(make_result(grant.spec), 150, 700)
        book.complete(Completion("w", grant.run, grant.attempt, grant.token, result), NOW)


@pytest.mark.usefixtures("large_results")
def test_a_client_goes_on_after_a_page_that_is_shorter_than_asked(reader):
    assert 0 < len(reader.runs("c", limit=1000, results=True).rows) < RUNS
    records = reader.all_runs("c", results=True)
    assert [record.id for record in records] == [f"c.{number}" for number in range(RUNS)]


def test_a_page_of_runs_ends_at_its_bytes(db, reader):
    LedgerWriter(db).submit(make_submission("c", 300), NOW)
    db.execute("UPDATE run SET reason = ?", ("x" * 20_000,))
    db.commit()
    page = reader.runs("c", limit=1000)
    assert 0 < len(page.rows) < page.total == 300
    last = reader.runs("c", limit=1000, offset=290)
    assert (len(last.rows), last.total) == (10, 300)
