"""The history of a campaign: three submissions in a ledger, what changed, the page about it."""

import re
from dataclasses import replace

import pytest

from daemon.analysis.history import history_page, read_history
from daemon.batch.ledger import LedgerReader, LedgerWriter, connect
from daemon.batch.paths import StatePaths
from daemon.judging.assessment import assess
from daemon.model.assessments import AssessmentRules, RepeatPolicy
from daemon.model.messages import Completion
from daemon.model.spec import OracleText, SutReference, Timing
from daemon.model.submission import CampaignOrigin
from daemon.model.verdicts import Outcome
from scenario_tui.cli import invoke
from tests.analysis.page_text import text_of
from tests.make import make_result, make_search, make_spec, submission_of
from tests.people.cli.outputs import declared

REPEATS = 5
HOSTILE = "<script>alert(1)</script>"


def specs(scenarios=("S1", "S2"), oracle="within 10 s", **parameters):
    sut, oracles = SutReference("pilot", "pilot", parameters), (OracleText("arrives", oracle),)
    return [
        replace(make_spec(repeat, scenario=scenario), sut=sut, oracles=oracles)
        for scenario in scenarios
        for repeat in range(REPEATS)
    ]


def origin(commit, *, changed=False, digest="1" * 64):
    return CampaignOrigin("c.yaml", digest, 7, commit, "main", changed)


def execute(book, places, now, name, specs, margin, **changes):
    """Submit runs and execute them, with margins [s] that are a function of the specification."""
    book.submit(replace(submission_of(name, *specs), name="demo", **changes), now)
    while grants := book.lease("w", 100, now):
        for grant in grants:
            path = places.trace(grant.trace)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(b"trace")
            outcome = Outcome.FAIL if margin(grant.spec) < 0.0 else Outcome.PASS
            result = make_result(grant.spec, outcome=outcome, margin=margin(grant.spec))
            result = replace(result, timing=Timing(2.0, 1.5, 20.0), machine="bench")
            book.complete(Completion("w", grant.run, grant.attempt, grant.token, result), now)


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    """Three submissions: another speed, then another oracle and scenario, and two searches."""
    places = StatePaths(tmp_path_factory.mktemp("history") / "state")
    places.make_folders()
    connection = connect(places.ledger)
    book = LedgerWriter(connection, paths=places)
    rules = AssessmentRules(RepeatPolicy(n=REPEATS, rule="rate", rate=0.9))
    fast = {"speed": 1.5, "label": HOSTILE}
    for now, (name, runs, margin, changes) in enumerate((
        ("demo-1", specs(speed=1.0), lambda spec: 2.0, {"origin": origin("a" * 40)}),
        (
            "demo-2",
            specs(**fast),
            lambda spec: 0.5 + 0.01 * spec.repeat,
            {"origin": origin("b" * 40, changed=True)},
        ),
        (
            "demo-3",
            specs(("S1", "S3"), "within 8 s", **fast),
            lambda spec: -0.25 if spec.repeat > 1 else 0.5,
            {"origin": origin("b" * 40, digest="2" * 64), "declared": rules},
        ),
    )):  # fmt: skip
        execute(book, places, 1_000_000.0 + 3600.0 * now, name, runs, margin, **changes)
    for campaign, name in (("demo-search-4", "demo"), ("doors-5", "doors")):
        book.begin_search(replace(make_search(campaign), name=name), 1_010_000.0)
    yield places
    connection.close()


@pytest.fixture
def reader(places):
    with LedgerReader.open(places) as reader:
        yield reader


@pytest.fixture
def history(reader):
    return read_history(reader, "demo")


@pytest.fixture
def undrawn(monkeypatch):
    """Pages without drawings: whoever starts Vega waits for a second."""
    draw = "daemon.analysis.charts.draw_charts"
    monkeypatch.setattr(draw, lambda charts: ["<svg></svg>"] * len(charts))


@pytest.fixture
def state(places, undrawn, tmp_path, monkeypatch):
    """The state directory of commands."""
    monkeypatch.setenv("SCENARIO_STATE", str(places.ledger.parent))
    monkeypatch.chdir(tmp_path)


def test_an_oracle_of_a_submission_is_judged_as_its_campaign_says(history, reader):
    newest = history.submissions[-1]
    oracle = newest.oracles[0]
    assert (newest.machines, newest.cpu) == (("bench",), 15.0)
    assert (oracle.simulated, oracle.cpu, oracle.worst) == (20.0, 1.5, -0.25)
    records = reader.all_runs("demo-3", results=True)
    judged = assess(reader.declared("demo-3"), records).cells[0].oracles[0]
    assert (oracle.low, oracle.high, oracle.verdict) == (judged.low, judged.high, judged.word)


@pytest.mark.parametrize(
    ("count", "headline"),
    [
        (3, "1 of 2 verdicts changed since demo-2: arrives of S1 (pilot) pass → fail, 5/5 → 2/5"),
        (2, "none of 2 verdicts changed since demo-1, but values did: arrives of S1 (pilot) "
            "2 → 0.52 s and arrives of S2 (pilot) 2 → 0.52 s"),
        (1, "demo-1 is the only submission of demo: nothing to compare yet"),
    ],
)  # fmt: skip
def test_the_first_sentence_says_what_is_new(history, count, headline):
    assert replace(history, submissions=history.submissions[:count]).headline == headline


@pytest.mark.usefixtures("undrawn")
def test_the_page_tells_what_changed_and_no_name_becomes_part_of_it(history, golden):
    page = history_page(history)
    golden("history.txt", text_of(page))
    assert HOSTILE not in page
    assert history_page(replace(history, submissions=history.submissions[:1]))


def test_the_command_writes_page_and_json(state, tmp_path, capsys):
    assert invoke(["report", "demo", "--history", "-o", "h.html"]) == 0
    assert (tmp_path / "h.html").stat().st_size
    assert capsys.readouterr().out.startswith("demo: 1 of 2 verdicts changed since demo-2")
    for name in ("demo", "demo-2"):
        assert invoke(["report", name, "--history", "--json"]) == 0
        body = declared(capsys.readouterr().out)
        assert body["schema"] == "scenario/history/1"
        submissions = [one["id"] for one in body["history"]["submissions"]]
        assert submissions == ["demo-1", "demo-2", "demo-3"]


def test_a_name_that_nobody_submitted_is_refused(state, capsys):
    for words, message in (
        (["dmeo"], r"(?s)dmeo.*demo"),
        (["doors"], "doors is a search"),
        (["demo", "--table", "a.csv"], "table"),
    ):
        assert invoke(["report", *words, "--history"]) == 2
        assert re.search(message, capsys.readouterr().err)
