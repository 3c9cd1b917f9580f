"""``scenario report`` and ``scenario coverage`` of searches, from the ledger alone."""

from dataclasses import replace
from pathlib import Path

import pytest

from daemon.batch.ledger import LedgerWriter, connect
from daemon.batch.paths import StatePaths
from daemon.batch.server._search_handlers import read_extension
from daemon.model.messages import Completion
from daemon.model.proposals import ExtendRequest
from daemon.model.search import OracleScale
from daemon.model.search_answer import SearchAnswer, SearchProgress
from daemon.model.spec import LeadingMargin
from daemon.model.submission import Submission
from daemon.model.trials import Trial
from grammars.text import codec
from scenario_tui.cli import invoke
from tests.analysis.report.recordings import SHUT, SUTS, record, spec
from tests.engine.judging.traces import CORRIDOR
from tests.make import TASK, make_proposal, make_search
from tests.people.cli.outputs import declared
from tests.people.recorded import result_of_trace

SEARCH = "corridor-doors-1"


@pytest.fixture(scope="module")
def ledger(tmp_path_factory):
    """A state directory with a finished search of two runs."""
    places = StatePaths(tmp_path_factory.mktemp("searched") / "state")
    places.make_folders()
    connection = connect(places.ledger)
    book = LedgerWriter(connection, paths=places)
    first = spec(SHUT, SUTS[0], 0)
    oracle = first.oracles[0].name
    submission = make_search(SEARCH, minimise=oracle, scales=(OracleScale(oracle, 1.0, "m"),))
    book.begin_search(submission, 1.0)
    specs = tuple(replace(first, scenario=TASK.scenario_of(n), seed=n) for n in range(2))
    runs = Submission.of(SEARCH, specs, (CORRIDOR,))
    proposals = (make_proposal(0), make_proposal(1))
    request = ExtendRequest("lab", proposals, runs)
    staged = read_extension(codec.to_json(request), places)
    with book.transaction():
        book.extend(proposals, staged.runs, 1.0)
    for grant in book.lease("w", 2, 1.0):
        path = record(places.trace(grant.trace), grant.spec)
        leads = (LeadingMargin(oracle, 0.25, "m", "door"),)
        result = replace(result_of_trace(path), leads=leads)
        book.complete(Completion("w", grant.run, grant.attempt, grant.token, result), 2.0)
    best = Trial(proposals[0], f"{SEARCH}.0", "doors.0/a/0", "d")
    answer = SearchAnswer("errors", 2, 2, 0, 0, 0, 0, 2, 0, best=best, sentences=("", "a sentence"))
    book.note_progress(SearchProgress(SEARCH, "lab", "explore", "", "finished", answer), 3.0)
    connection.close()
    return places


@pytest.fixture(autouse=True)
def _here(ledger, tmp_path, monkeypatch):
    monkeypatch.setenv("SCENARIO_STATE", str(ledger.state))
    monkeypatch.chdir(tmp_path)
    # A folder called like the search does not hide it.
    Path("corridor").mkdir()


def test_a_search_becomes_a_page(capsys):
    assert invoke(["report", "corridor", "-o", "s.html"]) == 0
    assert f"doors ({SEARCH}): reached does not fail in 2 runs" in capsys.readouterr().out
    page = Path("s.html").read_text()
    for words in ("can it fail?", "a sentence", "the whole way", "margin over the values that"):
        assert words in page


@pytest.mark.parametrize("name", [SEARCH, "corridor", "doors", ""])
def test_tables_of_a_search_are_refused(name, capsys):
    assert invoke(["report", *filter(None, [name]), "--junit", "r.xml"]) == 2
    said = " ".join(capsys.readouterr().err.replace("│", " ").split())
    assert f"scenario search {SEARCH} --json" in said
    assert not Path("r.xml").exists()


def test_coverage_has_the_runs_of_a_search(capsys):
    assert invoke(["coverage", SEARCH, "--json", "--processes", "1"]) == 0
    assert declared(capsys.readouterr().out)["recorded"] == 2
    assert invoke(["coverage", f"{SEARCH}.1"]) == 0
    assert capsys.readouterr().out.startswith("1 run, by their traces")


def test_a_campaign_file_says_which_searches_it_has(campaigns, capsys):
    assert invoke(["coverage", str(campaigns / "demo" / "campaign.yaml")]) == 0
    assert "name its id here once it has run" in capsys.readouterr().err
