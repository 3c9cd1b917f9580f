"""``scenario report`` and ``scenario coverage`` of searches."""

from dataclasses import replace
from itertools import cycle
from pathlib import Path

import pytest

from tests.analysis.report.recordings import SHUT, SUTS, record, spec
from tests.make import with_result
from tests.people.cli.outputs import declared
from tests.people.fake_search import SEARCH, make_proposals, make_search
from tests.people.recorded import result_of_trace


@pytest.fixture(autouse=True)
def _here(fake, tmp_path, monkeypatch):
    """A finished search whose runs are recorded."""
    monkeypatch.chdir(tmp_path)
    paths = [record(tmp_path / f"{sut}.mcap", spec(SHUT, sut, 0)) for sut in SUTS]
    infos = [result_of_trace(path).trace for path in paths]
    fake.found = (make_search(),)
    fake.proposed = tuple(
        replace(with_result(row, trace=info), trace=str(path))
        for row, path, info in zip(make_proposals(), cycle(paths), cycle(infos), strict=False)
    )
    # A folder called like the search does not hide it.
    Path("house").mkdir()


def test_a_search_becomes_a_page(scenario):
    said = scenario("report", "house", "-o", "s.html")
    assert said.code == 0
    assert f"doors-in-time ({SEARCH}): keeps-clear fails in 5 of 5 repeats" in said.out
    page = Path("s.html").read_text()
    for words in ("can it fail?", "2 of 8 runs fail", "the whole way", "Dots pass, crosses fail"):
        assert words in page


@pytest.mark.parametrize("name", [SEARCH, "house", "doors-in-time", ""])
def test_tables_of_a_search_are_refused(name, scenario):
    said = scenario("report", *filter(None, [name]), "--junit", "r.xml")
    assert said.code == 2
    assert f"scenario search {SEARCH} --json" in said.err
    assert not Path("r.xml").exists()


def test_coverage_has_the_runs_of_a_search(scenario):
    said = scenario("coverage", SEARCH, "--json", "--processes", "1")
    assert declared(said.out)["recorded"] == len(SUTS)
    assert scenario("coverage", f"{SEARCH}.1").out.startswith("1 run, by their traces")


def test_a_campaign_file_says_which_searches_it_has(scenario, campaigns):
    said = scenario("coverage", str(campaigns / "demo" / "campaign.yaml"))
    assert "name its id here once it has run" in said.err
