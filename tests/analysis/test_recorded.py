"""A folder of traces as a source: it answers what a daemon answers of its campaigns."""

import shutil
from contextlib import nullcontext

import pytest

from daemon.analysis.recorded import read_traces
from daemon.batch.errors import Refused
from daemon.model.verdicts import Outcome
from tests.analysis.report.recordings import NAME, OPEN, SHUT, SUTS, record, spec

RUNS = [(OPEN, SUTS[0]), (SHUT, SUTS[0]), (OPEN, SUTS[1])]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("traces")
    for number, (scenario, sut) in enumerate(RUNS):
        record(folder / f"{number}.mcap", spec(scenario, sut, 0))
    return str(folder)


@pytest.fixture
def works():
    """Works that were shown, as (unit, total)."""
    return []


@pytest.fixture
def source(folder, works):
    def progress(_, total, unit):
        works.append((unit, total))
        return nullcontext(lambda _: None)

    return read_traces(folder, progress=progress)


def test_its_campaign_is_called_as_it_was_typed(source, folder):
    (row,) = source.campaigns()
    assert (row.id, row.name, row.total, row.finished) == (folder, NAME, 3, True)
    assert source.campaign(folder) == row
    assert source.campaign_page(beginning="other") == source.campaign_page(offset=1) == ()
    assert source.searches() == ()


def test_pages_of_runs_are_filtered_and_sorted(source):
    ids = [row.id for row in source.all_runs("")]
    first, second = source.runs("", limit=2), source.runs("", offset=2, limit=2)
    assert [row.id for row in (*first.rows, *second.rows)] == ids
    assert (first.total, second.total) == (3, 3)
    assert [row.id for row in source.runs("", sut=SUTS[1]).rows] == ids[2:]
    assert [row.id for row in source.runs("", text="2.MCAP").rows] == ids[2:]
    assert [row.id for row in source.runs("", sort="id", descending=True).rows] == ids[::-1]
    failed = {row.id for row in source.runs("", outcome="fail").rows}
    assert failed == {row.id for row in source.all_runs("") if row.outcome is Outcome.FAIL} != set()


def test_traces_of_a_run_that_goes_on_do_not_count_beside_earlier_ones(folder, tmp_path):
    going_on = tmp_path / ".scenario-1" / "traces"
    shutil.copytree(folder, going_on)
    assert len(read_traces(str(tmp_path)).rows) == 3
    shutil.copy(going_on / "0.mcap", tmp_path)
    assert [row.id for row in read_traces(str(tmp_path)).rows] == [str(tmp_path / "0.mcap")]


def test_runs_are_judged_once_and_only_when_they_are_asked_for(source, works, folder):
    assert source.declared(folder)
    assert source.campaigns()
    assert works == []
    assert source.run(f"{folder}/1.mcap").row.result is not None
    assert [row.margin is not None for row in source.all_runs("")] == [True] * 3
    source.all_runs("", results=True)
    assert works == [("traces", 1), ("traces", 2)]


def test_without_progress_traces_stay_unjudged_for_whoever_reads_them_anyway(folder):
    rows = read_traces(folder).all_runs(folder, results=True)
    assert [(row.outcome, row.result) for row in rows] == [(None, None)] * 3


def test_a_run_that_it_has_not_is_refused(source):
    with pytest.raises(Refused, match=r"there is no run 9.mcap in "):
        source.run("9.mcap")
