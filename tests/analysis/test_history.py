"""The history of a campaign: three submissions in a ledger, what changed, the page about it."""

import re
from dataclasses import replace

import html5lib
import pytest

from daemon.analysis.history import read_history
from daemon.analysis.history_page import history_page
from daemon.batch.ledger import LedgerReader, LedgerWriter, connect
from daemon.batch.paths import StatePaths
from daemon.judging.assessment import assess
from daemon.model.assessments import AssessmentRules, RepeatPolicy
from daemon.model.messages import Completion
from daemon.model.spec import OracleText, SutReference, Timing
from daemon.model.submission import CampaignOrigin
from daemon.model.verdicts import Outcome
from scenario_tui.cli import invoke
from tests.chromium import CHROMIUM, chromium_page
from tests.make import make_result, make_search, make_spec, submission_of
from tests.people.cli.outputs import declared

REPEATS = 5
HOSTILE = "<script>alert(1)</script>"


def specs(scenarios=("S1", "S2"), oracle="within 10 s", **parameters):
    return [
        replace(
            make_spec(repeat, scenario=scenario),
            sut=SutReference("pilot", "pilot", parameters),
            oracles=(OracleText("arrives", oracle),),
        )
        for scenario in scenarios
        for repeat in range(REPEATS)
    ]


class History:
    """A state directory to which submissions are added, each executed at once."""

    def __init__(self, folder):
        self.places = StatePaths(folder)
        self.places.make_folders()
        self._connection = connect(self.places.ledger)
        self._connection.execute("PRAGMA synchronous = OFF")
        self._book = LedgerWriter(self._connection, paths=self.places)
        self._now = 1_000_000.0

    def submit(self, name, specs, margin, **changes):
        """Enter and execute runs whose margin [s] is a function of their specification."""
        self._now += 3600.0
        submission = replace(submission_of(name, *specs), name="demo", **changes)
        self._book.submit(submission, self._now)
        while grants := self._book.lease("w", 100, self._now):
            for grant in grants:
                path = self.places.trace(grant.trace)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(b"trace")
                outcome = Outcome.FAIL if margin(grant.spec) < 0.0 else Outcome.PASS
                result = make_result(grant.spec, outcome=outcome, margin=margin(grant.spec))
                result = replace(result, timing=Timing(2.0, 1.5, 20.0), machine="bench")
                done = ("w", grant.run, grant.attempt, grant.token)
                self._book.complete(Completion(*done, result), self._now)

    def search(self, campaign, name):
        """Enter a search."""
        self._book.begin_search(replace(make_search(campaign), name=name), self._now)

    def close(self):
        self._connection.close()


def origin(commit, *, changed=False, digest="1" * 64):
    return CampaignOrigin("c.yaml", digest, 7, commit, "main", changed)


@pytest.fixture
def ledger(tmp_path, monkeypatch):
    """Three submissions: another speed, then another oracle and scenario, and a search."""
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path / "state"))
    monkeypatch.chdir(tmp_path)
    history = History(tmp_path / "state")
    history.submit("demo-1", specs(speed=1.0), lambda spec: 2.0, origin=origin("a" * 40))
    history.submit(
        "demo-2",
        specs(speed=1.5, label=HOSTILE),
        lambda spec: 0.5 + 0.01 * spec.repeat,
        origin=origin("b" * 40, changed=True),
    )
    history.submit(
        "demo-3",
        specs(("S1", "S3"), "within 8 s", speed=1.5, label=HOSTILE),
        lambda spec: -0.25 if spec.repeat > 1 else 0.5,
        origin=origin("b" * 40, digest="2" * 64),
        declared=AssessmentRules(RepeatPolicy(n=REPEATS, rule="rate", rate=0.9)),
    )
    history.search("demo-search-4", "demo")
    history.search("doors-5", "doors")
    yield history.places
    history.close()


@pytest.fixture
def history(ledger):
    with LedgerReader.open(ledger) as reader:
        return read_history(reader, "demo")


def test_submissions_stand_in_their_order_with_what_came_out(history, ledger):
    assert [one.id for one in history.submissions] == ["demo-1", "demo-2", "demo-3"]
    assert [one.as_expected for one in history.submissions] == [True, True, False]
    newest = history.submissions[-1]
    assert (newest.runs, newest.unfinished, newest.cpu) == (10, 0, 15.0)
    assert (newest.machines, newest.commit, newest.uncommitted) == (("bench",), "b" * 40, False)
    oracle = newest.oracles[0]
    assert (oracle.cell, oracle.simulated, oracle.cpu) == (("S1", "pilot"), 20.0, 1.5)
    assert (oracle.passed, oracle.n, oracle.worst, oracle.median) == (2, 5, -0.25, -0.25)
    with LedgerReader.open(ledger) as reader:
        records = reader.all_runs("demo-3", results=True)
        judged = assess(reader.declared("demo-3"), records).cells[0].oracles[0]
    assert (oracle.low, oracle.high, oracle.verdict) == (judged.low, judged.high, judged.word)


def test_what_a_submission_is_made_of_is_compared_with_the_one_before(history):
    first, second, third = (one.changes for one in history.submissions)
    assert first == ()
    assert set(second) == {
        f"commit {'a' * 12} → {'b' * 12} with uncommitted changes",
        "system pilot: speed 1.0 → 1.5",
        f'system pilot: label came ("{HOSTILE}")',
    }
    assert set(third) == {
        "scenario S2 went",
        "scenario S3 came",
        "campaign file changed",
        f"commit {'b' * 12} with uncommitted changes → {'b' * 12}",
        "repeats 1 → 5",
        "policy all → rate 0.9",
        "scenario S1: oracle arrives within 10 s → within 8 s",
    }


def test_the_first_sentence_says_what_is_new(history):
    assert history.headline == (
        "1 of 2 verdicts changed since demo-2: arrives of S1 (pilot) pass → fail, 5/5 → 2/5"
    )
    slower = replace(history, submissions=history.submissions[:2])
    assert slower.headline == (
        "none of 2 verdicts changed since demo-1, but values did: arrives of S1 (pilot) "
        "2 → 0.52 s and arrives of S2 (pilot) 2 → 0.52 s"
    )
    alone = replace(history, submissions=history.submissions[:1])
    assert alone.headline == "demo-1 is the only submission of demo: nothing to compare yet"


def test_the_page_has_a_chart_for_each_cell_and_nothing_of_what_names_do(history):
    page = history_page(history)
    html5lib.HTMLParser(strict=True).parse(page)
    assert page == history_page(history)
    before = page[: page.rindex("<script>")]
    assert before.count('<div class="chart"') == 3
    assert f"{history.headline[1:]}." in before.replace("&gt;", ">")
    assert HOSTILE not in page
    assert "system pilot: speed 1.0 → 1.5" in before
    assert history_page(replace(history, submissions=history.submissions[:1]))


def test_times_are_drawn_of_every_submission_also_where_oracles_have_other_names(history):
    def times(history):
        (lines, *_) = re.findall(
            r'aria-label="S1 .*?<path d="([^"]*)" stroke="var\(--second\)"', history_page(history)
        )
        return lines

    *older, newest = history.submissions
    renamed = tuple(replace(one, oracle="arrives soon") for one in newest.oracles)
    other = replace(history, submissions=(*older, replace(newest, oracles=renamed)))
    assert times(other).count("L") == times(history).count("L") == 2


LEGEND_ENTRY = """(() => {
  const box = [...document.querySelectorAll("#cells .live .role-legend-label text")]
    .find((text) => text.textContent === "clear").getBoundingClientRect();
  return [box.x + box.width / 2, box.y + box.height / 2];
})()"""


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed")
def test_an_oracle_that_is_clicked_in_the_legend_is_shown_alone(history, tmp_path):
    newest = history.submissions[-1]
    clear = [replace(one, oracle="clear", unit="m") for one in newest.oracles]
    # Whether a mission is done has no margin.
    done = [replace(one, oracle="done", unit="", worst=None, median=None) for one in clear]
    submission = replace(newest, oracles=(*newest.oracles, *clear, *done))
    file = tmp_path / "history.html"
    file.write_text(history_page(replace(history, submissions=(submission,) * 2)), "utf-8")
    faded = "document.querySelectorAll('#cells figure:first-of-type [opacity=\"0.1\"]').length"
    with chromium_page(file.as_uri(), tmp_path, width=500) as page:
        page.evaluate("document.documentElement.style.scrollBehavior = 'auto'")
        page.evaluate("document.querySelector('#cells').scrollIntoView()")
        page.wait("document.querySelectorAll('#cells .live .mark-line path').length")
        assert page.evaluate(faded) == 0
        x, y = page.evaluate(LEGEND_ENTRY)
        page.point("Moved", x, y)
        page.point("Pressed", x, y, held=True)
        page.point("Released", x, y, held=True)
        assert page.wait(faded) > 0
        assert page.evaluate("document.documentElement.scrollWidth") <= 500
        assert page.problems == []


@pytest.mark.parametrize("name", ["demo", "demo-2"])
def test_the_command_writes_page_and_json(ledger, capsys, name):
    assert invoke(["report", name, "--history", "-o", "h.html"]) == 0
    assert capsys.readouterr().out.startswith("demo: 1 of 2 verdicts changed since demo-2")
    assert invoke(["report", name, "--history", "--json"]) == 0
    body = declared(capsys.readouterr().out)
    assert body["schema"] == "scenario/history/1"
    assert [one["id"] for one in body["history"]["submissions"]] == ["demo-1", "demo-2", "demo-3"]


def test_a_name_that_nobody_submitted_is_refused_with_what_there_is(ledger, capsys):
    assert invoke(["report", "dmeo", "--history"]) == 2
    assert "demo" in capsys.readouterr().err.partition("dmeo")[2]
    assert invoke(["report", "doors", "--history"]) == 2
    assert "doors is a search" in capsys.readouterr().err
    assert invoke(["report", "demo", "--history", "--table", "a.csv"]) == 2
