"""What commands say of runs that have no result: the state they are in, and never a verdict."""

import time
from dataclasses import replace
from pathlib import Path

import pytest

from daemon.batch.ledger import LedgerWriter, connect
from daemon.batch.paths import StatePaths
from daemon.batch.stores import file_sha256
from daemon.judging.oracles import judge, overall_outcome
from daemon.model.assessments import AssessmentRules, Expectation, RepeatPolicy, ScenarioComparison
from daemon.model.messages import Completion, ReleaseRequest, SteerRequest
from daemon.model.spec import RunResult, Timing, TraceInfo
from daemon.model.submission import Submission
from daemon.trace import read_trace
from scenario_tui.cli import invoke
from tests.analysis.report.recordings import OPEN, SHUT, SUTS, record, spec
from tests.engine.judging.traces import CORRIDOR
from tests.parts import daemon_at

RULES = AssessmentRules(
    RepeatPolicy(n=2),
    (ScenarioComparison("delay", "delay", "S1", "S2", None, "<=", 30.0, "s", "delay(S1 vs S2)"),),
    (Expectation("S1", "buffer", (), "fail", "the corridor is narrow"),),
)
STATES = ("queued", "paused", "running", "cancelled", "lost", "half", "retrying")
"""Campaigns, named after the state of their first run; of ``half`` S1 has finished, S2 waits."""
NEVER = (
    "inconclusive",
    "did not end the mission",
    "no oracle",
    "expected fail",
    "is no trace, no folder",
    "not remembered",
    "Traceback",
)
"""What nothing says of runs without a result."""
NOT_OVER = (*NEVER, "could not be executed", "undecided", "Not known")
"""Nor of runs that may still have one."""
FORBIDDEN = dict.fromkeys(STATES, NOT_OVER) | {"cancelled": NEVER, "lost": NEVER}

WAITS = {
    "queued": "is queued: the next of its campaign",
    "paused": "is queued: its campaign is paused, `scenario pause paused-1 --off`",
    "running": "is running: its trace is there when it ends",
    "retrying": "is queued: once more, the stack crashed",
    "cancelled": "was cancelled before it ended; `scenario retry cancelled-1`",
    "lost": "is lost, 3 attempts left no result: the stack crashed; `scenario retry lost-1`",
}
"""What is said of a run by commands that read its trace."""
NO_TRACES = {
    "queued": "no run of queued-1 has a trace yet: 4 queued",
    "paused": "no run of paused-1 has a trace yet: 4 queued, paused",
    "running": "no run of running-1 has a trace yet: 1 running, 3 queued",
    "retrying": "no run of retrying-1 has a trace yet: 4 queued",
    "cancelled": "no run of cancelled-1 has a trace: 4 cancelled; `scenario retry cancelled-1`",
    "lost": "no run of lost-1 has a trace: 4 lost; `scenario retry lost-1`",
}
"""What is said of a campaign by commands that read its traces."""


def runs_of(campaign):
    return tuple(
        replace(spec(like, SUTS[0], repeat), scenario=scenario, campaign=campaign)
        for scenario, like in (("S1", SHUT), ("S2", OPEN))
        for repeat in range(2)
    )


class Ledger:
    """A state directory in the making; ``now`` is its clock."""

    def __init__(self, places):
        places.make_folders()
        self.places, self.now = places, time.time()
        self.connection = connect(places.ledger)
        self.book = LedgerWriter(self.connection)

    def submit(self, state):
        sent = Submission.of(f"{state}-1", runs_of(state), (CORRIDOR,))
        self.book.submit(replace(sent, name=state, declared=RULES, fresh=True), self.now)

    def lease(self, count):
        return self.book.lease("w", count, self.now)

    def fail(self, count, *, blame):
        for grant in self.lease(count):
            given_back = ReleaseRequest("w", grant.run, grant.token, "the stack crashed", blame)
            self.book.release(given_back, self.now)

    def finish(self, count):
        for grant in self.lease(count):
            path = record(self.places.trace(grant.trace), grant.spec)
            trace = read_trace(path)
            verdicts = judge(trace, grant.spec.oracles)
            info = TraceInfo(file_sha256(path), path.stat().st_size, 1)
            result = RunResult(
                grant.spec.digest, overall_outcome(trace, verdicts), verdicts, "finished", info,
                Timing(1.5, 1.0, 20.0),
            )  # fmt: skip
            done = Completion("w", grant.run, grant.attempt, grant.token, result)
            self.book.complete(done, self.now)

    def bring_to(self, state):
        self.submit(state)
        if state == "half":
            self.finish(2)
        elif state == "running":
            self.lease(1)
        elif state == "retrying":
            for _ in range(7):
                self.fail(4, blame=False)
        elif state == "lost":
            for _ in range(3):
                self.fail(4, blame=True)
        elif state == "cancelled":
            self.book.cancel("cancelled-1", self.now)
        # So that nothing of it is leased for the next one, which those that wait never are.
        self.book.steer(SteerRequest(f"{state}-1", paused=True), self.now)


@pytest.fixture(scope="module")
def state(tmp_path_factory):
    """A daemon without workers that has a campaign in every state."""
    places = StatePaths(tmp_path_factory.mktemp("words") / "state")
    ledger = Ledger(places)
    for name in STATES:
        ledger.bring_to(name)
    for name in STATES:
        ledger.book.steer(SteerRequest(f"{name}-1", paused=name == "paused"), ledger.now)
    ledger.connection.close()
    with daemon_at(places.state) as daemon:
        daemon.client().close()
        yield places.state


@pytest.fixture
def say(state, tmp_path, monkeypatch, capsys):
    monkeypatch.delenv("SCENARIO_CONNECT", raising=False)
    monkeypatch.setenv("SCENARIO_STATE", str(state))
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.chdir(tmp_path)
    return Say(capsys)


class Say:
    """Runs commands; what they say has one blank where it had several, or a line's end."""

    def __init__(self, capsys):
        self._capsys = capsys

    def __call__(self, *arguments):
        code = invoke(arguments)
        said = self._capsys.readouterr()
        return code, " ".join((said.out + said.err).split())


def check(said, state, *right):
    for words in right:
        assert words in said
    for words in FORBIDDEN[state]:
        assert words not in said


READERS = {
    "plot": ("plot", "{}", "speed"),
    "replay": ("replay", "{}", "--frame", "1"),
    "export": ("export", "{}", "traces"),
    "judge": ("judge", "{}"),
    "verify": ("verify", "{}"),
    "coverage": ("coverage", "{}"),
    "blame": ("blame", "{}"),
}


@pytest.mark.parametrize("command", READERS)
@pytest.mark.parametrize("name", WAITS)
def test_commands_that_read_traces_say_why_a_run_has_none(say, name, command):
    code, said = say(*(part.format(f"{name}-1.0") for part in READERS[command]))
    assert code == 2
    check(said, name, f"{name}-1.0 {WAITS[name]}")


@pytest.mark.parametrize("command", ["export", "judge", "coverage", "verify"])
@pytest.mark.parametrize("name", NO_TRACES)
def test_commands_that_read_traces_say_why_a_campaign_has_none(say, name, command):
    more = ("traces",) if command == "export" else ()
    code, said = say(command, f"{name}-1", *more)
    assert code == 2
    check(said, name, NO_TRACES[name])


def test_a_run_further_back_says_how_many_are_before_it(say):
    assert (
        "queued-1.3 is queued: 3 runs of its campaign queued before it"
        in say("plot", "queued-1.3", "speed")[1]
    )


RESULTS = {
    "queued": ("0 of 4 runs finished", "… queued 0/2", "… queued – n=0",
               "nothing to compare; 4 runs queued", "none judged; 4 queued"),
    "paused": ("0 of 4 runs finished", "… queued 0/2", "none judged; 4 queued, paused"),
    "running": ("▶ running 0/2", "… queued 0/2", "nothing to compare; 1 run running, 3 runs queued",
                "none judged; 1 running, 3 queued"),
    "retrying": ("… queued 0/2", "none judged; 4 queued"),
    "cancelled": ("4 runs", "- cancelled 0/2", "nothing to compare; 4 runs cancelled",
                  "4 runs cancelled"),
    "lost": ("∅ lost 0/2", "4 runs not executed", "nothing to compare; 4 runs lost"),
    "half": ("2 of 4 runs finished", "… queued 0/2", "nothing to compare; 2 runs queued",
             "so far fine; 2 queued"),
}  # fmt: skip


@pytest.mark.parametrize("name", STATES)
def test_results_say_how_runs_stand(say, name):
    _, said = say("results", f"{name}-1")
    check(said, name, *RESULTS[name])
    if name != "lost":
        assert " ! " not in said, "nothing that may still come out as expected is marked"


SHOWN = {
    "queued": ("… queued", "will be judged by", "is queued: the next of its campaign"),
    "paused": ("… queued", "will be judged by", "its campaign is paused"),
    "running": ("▶ running", "will be judged by"),
    "retrying": ("… queued", "the stack crashed", "will be judged by"),
    "cancelled": ("- cancelled", "was cancelled before it ended", "was to be judged by",
                  "scenario retry cancelled-1"),
    "lost": ("∅ lost", "the stack crashed", "was to be judged by", "scenario retry lost-1"),
}  # fmt: skip


@pytest.mark.parametrize("name", SHOWN)
def test_a_run_is_shown_as_it_stands(say, name):
    code, said = say("show", f"{name}-1.0")
    assert code == 0
    check(said, name, *SHOWN[name])


LOGS = {
    "queued": "queued-1.0 is queued: the next of its campaign",
    "paused": "paused-1.0 is queued: its campaign is paused",
    "running": "running",
    "retrying": "queued the stack crashed",
    "cancelled": "was cancelled before it ended",
    "lost": "lost the stack crashed",
}


@pytest.mark.parametrize("name", LOGS)
def test_logs_of_a_run_without_a_result_tell_its_attempts(say, name):
    code, said = say("show", f"{name}-1.0", "--log")
    assert code == 0
    check(said, name, LOGS[name])


WAITED = {
    "queued": "4 runs left after 0 s, … none judged",
    "paused": "4 runs left after 0 s, … none judged",
    "running": "4 runs left after 0 s, ▶ none judged",
    "retrying": "4 runs left after 0 s, … none judged",
    "cancelled": "cancelled-1: - cancelled",
    "lost": "lost-1: ∅ not all judged",
    "half": "2 runs left after 0 s, ▶ so far fine",
}


@pytest.mark.parametrize("name", STATES)
def test_who_waits_in_vain_is_told_what_is_known(say, name):
    code, said = say("wait", f"{name}-1", "--timeout", "0.01s")
    assert code == (3 if name == "lost" else 4)
    check(said, name, WAITED[name])


REPORTED = {
    "queued": "Not yet. 4 queued of 4 runs.",
    "paused": "Not yet. 4 queued of 4 runs.",
    "running": "Not yet. 1 running, 3 queued of 4 runs.",
    "retrying": "Not yet. 4 queued of 4 runs.",
    "cancelled": "Not known. 4 cancelled of 4 runs.",
    "lost": "4 of 4 runs could not be executed or judged.",
    "half": "Not yet. 2 queued of 4 runs.",
}


@pytest.mark.parametrize("name", STATES)
def test_a_report_says_what_is_missing(say, name):
    _, said = say("report", f"{name}-1", "-o", "r.html", "--junit", "r.xml", "-j", "1")
    check(said, name, REPORTED[name])
    xml = Path("r.xml").read_text()
    assert "inconclusive" not in xml
    assert "no oracle" not in xml
    if name != "half":
        word = {"paused": "queued", "retrying": "queued"}.get(name, name)
        assert f'message="no run has a result: {word}" type="{word}"' in xml


def test_runs_to_come_are_no_changes_of_verdicts(say):
    _, said = say("compare", "half-1", "queued-1")
    check(said, "half", "half-1: 2 runs not finished", "queued-1: 4 runs not finished")
    assert "not judged" not in said


@pytest.mark.parametrize("command", ["judge", "coverage", "export"])
def test_of_a_campaign_that_goes_on_what_there_is_is_read_and_that_is_said(say, command):
    more = ("traces",) if command == "export" else ("-j", "1")
    code, said = say(command, "half-1", *more)
    assert code == (1 if command == "judge" else 0), "runs fail"
    assert "half-1 goes on (2 queued" in said
    assert "2 runs finished so far" in said


def test_status_says_what_is_paused_and_what_waits(say):
    code, said = say("status")
    assert code == 0
    check(
        said, "queued", "paused-1 (paused) 0/4 … 4 queued", "running-1 0/4 ▶ 1 running … 3 queued"
    )
    check(said, "lost", "lost-1 4/4 ∅ 4 lost")
    check(said, "cancelled", "cancelled-1 0/4 - 4 cancelled")
