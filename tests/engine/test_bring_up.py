"""What is told of an external system while it is brought up, and of how it failed."""

from dataclasses import replace

import pytest

from daemon.campaign import expand, load_campaign
from daemon.judging.run_log import ended_run_log
from daemon.model.spec import RunResult, SutReference
from daemon.model.sut import Decision, Progress, SutEvent, SutFailure
from daemon.model.verdicts import Outcome
from daemon.run import execute
from daemon.trace import read_outputs, read_trace
from grammars.text import codec
from tests.plugins import plug_in


class Outside:
    """An external system that waits for what a test says, and answers in a constant time."""

    period = 0.1
    needs_ground_truth = False

    def __init__(self, waiting, failure="", events=()):
        self._waiting, self._failure, self._events = waiting, failure, events

    def start(self, briefing):
        """Nothing to prepare."""

    def bring_up(self, first):
        yield from self._waiting
        if self._failure:
            raise SutFailure(self._failure, events=self._events)

    def update(self, observation):
        return Decision(None, Progress(0, 0, "active"), latency=0.012)

    def finish(self):
        """Fine."""

    def close(self):
        """Nothing to end."""

    def outputs(self):
        return {"stack.txt": b"up\xff\n"}


@pytest.fixture(scope="module")
def demo(campaigns):
    campaign = expand(load_campaign(campaigns / "demo" / "campaign.yaml"))
    outside = SutReference("outside", "outside", {"repeatable": False})
    spec = replace(campaign.specs[0], sut=outside, limit=1.0)
    return spec, next(s for s in campaign.scenes if s.digest == spec.scene)


def executed(demo, system, path, monkeypatch):
    plug_in(monkeypatch, "outside", lambda _: system)
    seen = []
    return execute(*demo, trace_path=path, on_progress=seen.append), seen


def test_what_is_waited_for_is_one_line_that_can_be_sent(demo, tmp_path, monkeypatch):
    said = (
        "starting my-nav2:\n 3 of 8 nodes active",
        # What a program printed may be no text: bytes that are no UTF-8, sequences for terminals.
        "waiting for \udcff\x1b[31mplanner",
        "x" * 100_000,
    )
    result, seen = executed(demo, Outside(said), tmp_path / "run.mcap", monkeypatch)
    assert result.ended == "limit"
    waited = [one for one in seen if one.waiting]
    assert [one.waiting for one in waited] == [
        "starting my-nav2: 3 of 8 nodes active",
        "waiting for \ufffd\ufffd[31mplanner",
        "x" * 120,
    ]
    assert {one.time for one in waited} == {0.0}
    assert [one.waiting for one in seen[3:]] == [""] * (len(seen) - 3)
    for one in seen:
        codec.to_json(one)
    assert read_trace(tmp_path / "run.mcap").latency.seconds.tolist() == [0.012] * 11
    assert read_outputs(tmp_path / "run.mcap") == {"stack.txt": "up\N{REPLACEMENT CHARACTER}\n"}


def test_a_repeatable_system_that_tells_its_latency_leaves_a_whole_trace(
    demo, tmp_path, monkeypatch
):
    spec, scene = demo
    again = replace(spec, sut=SutReference("outside", "outside", {}), limit=12.0)
    path = tmp_path / "run.mcap"
    result, _ = executed((again, scene), Outside(()), path, monkeypatch)
    trace = read_trace(path)
    assert (trace.complete, len(trace.latency.time)) == (True, 0)
    assert trace.ground_truth.time[-1] == 12.0
    assert result.ended == "limit"


def test_last_lines_that_are_no_text_still_make_a_result(demo, tmp_path, monkeypatch):
    system = Outside(("starting",), "it ended with exit code 3\n  Segmentation \udcfffault")
    result, _ = executed(demo, system, tmp_path / "run.mcap", monkeypatch)
    assert (result.ended, result.outcome) == ("crashed", Outcome.ERROR)
    assert result.note == "it ended with exit code 3\n  Segmentation \\udcfffault"
    assert codec.from_json(RunResult, codec.to_json(result)).note == result.note


def test_what_a_system_said_before_it_failed_is_in_the_log(demo, tmp_path, monkeypatch):
    events = (SutEvent("out of memory", "error", "planner"), SutEvent("bye"))
    system = Outside(("starting",), "it ended with exit code 9", events)
    executed(demo, system, tmp_path / "run.mcap", monkeypatch)
    log = read_trace(tmp_path / "run.mcap").events
    assert [(e.source, e.text, e.level) for e in log] == [
        ("planner", "out of memory", "error"),
        ("sut", "bye", "info"),
        ("sut", "it ended with exit code 9", "error"),
    ]
    said = [line.text for line in ended_run_log(read_trace(tmp_path / "run.mcap"))]
    assert said[-1] == "crashed"
    assert said.count("it ended with exit code 9") == 1


class _Watching:
    """Wants to know all the time what a run is judged by."""

    def __init__(self):
        self.told = []

    def wanted(self):
        return "everything"

    def tell(self, judgement):
        self.told.append(judgement)


@pytest.mark.parametrize("failure", ["", "it ended with exit code 3"])
def test_it_is_judged_from_its_bring_up_to_however_it_ends(demo, tmp_path, monkeypatch, failure):
    system = Outside(("starting", "3 of 8"), failure)
    plug_in(monkeypatch, "outside", lambda _: system)
    watching = _Watching()
    result = execute(
        *demo, trace_path=tmp_path / "run.mcap", on_progress=lambda _: None, judgements=watching
    )
    first, last = watching.told[0], watching.told[-1]
    assert (first.time, first.doors, first.reached) == (0.0, (), ())
    assert last.verdicts == result.verdicts
    assert result.ended == ("crashed" if failure else "limit")
