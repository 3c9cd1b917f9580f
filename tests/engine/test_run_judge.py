"""When a run that is watched is judged: soon for who opens it, and never for long."""

from types import SimpleNamespace
from typing import cast

import pytest

from daemon.model.spec import Snapshot
from daemon.run_judge import WatchedRun
from daemon.trace import TraceWriter
from grammars.model.geometry import Pose2
from tests.engine.judging.traces import along, cut, make_trace, mission, times

STEP = 0.25
"""Seconds between two snapshots."""
SNAPSHOT = Snapshot(1.0, 10.0, Pose2(1.0, 2.0), None, 0, 1, ())


class Judging:
    """A run whose judgements take as long as is said, on a clock of its own."""

    def __init__(self, monkeypatch, first, later):
        self.now = self._began = 100.0
        self.told = []
        self.costs = []
        self._first, self._later = first, later
        self._wanted = "nothing"
        self.refuses = False
        self.failure = None
        self._trace = cut(make_trace(along(times(4.0)), goal=mission((5.0, 0.0))), 4.0)
        clock = SimpleNamespace(perf_counter=lambda: self.now)
        monkeypatch.setattr("daemon.run_judge.time", clock)
        self._run = WatchedRun(cast("TraceWriter", self), lambda _: None, self)

    def so_far(self, ended, note):
        if self.failure is not None:
            raise self.failure
        self.costs.append(self._first if not self.costs else self._later)
        self.now += self.costs[-1]
        return self._trace

    def wanted(self):
        return self._wanted

    def tell(self, judgement):
        if self.refuses:
            raise UnicodeEncodeError("utf-8", "\ud800", 0, 1, "what a plug-in says")
        self.told.append(self.now)
        self.last = judgement

    def share(self):
        """Return how much of the run's time judging took: the first is free, two may be owed."""
        return sum(self.costs[3:]) / (self.now - self._began)

    def go_on(self, wanted, seconds):
        """Let the run go on for so long while that is wanted."""
        self._wanted = wanted
        end = self.now + seconds
        while self.now < end:
            self._run(SNAPSHOT)
            self.now += STEP


@pytest.mark.parametrize(("first", "later"), [(2.0, 0.2), (0.2, 0.2), (0.5, 0.5)])
@pytest.mark.parametrize("before", [0.3, 2.5, 10.1, 60.0])
def test_who_opens_a_run_is_told_within_a_second(monkeypatch, first, later, before):
    judging = Judging(monkeypatch, first, later)
    judging.go_on("margin", before)
    opened = judging.now
    judging.go_on("everything", 3.0)
    assert judging.told[0] <= opened + STEP + later


def test_the_second_judgement_does_not_wait_for_what_the_first_had_to_load(monkeypatch):
    judging = Judging(monkeypatch, first=2.0, later=0.05)
    judging.go_on("everything", 6.0)
    assert judging.told[1] <= judging.told[0] + 1.0 + STEP


@pytest.mark.parametrize(("wanted", "share"), [("margin", 0.05), ("everything", 0.1)])
def test_judging_keeps_to_its_share(monkeypatch, wanted, share):
    judging = Judging(monkeypatch, first=0.5, later=0.5)
    judging.go_on(wanted, 1000.0)
    assert 0.8 * share < judging.share() <= share


@pytest.mark.parametrize("away", ["nothing", "margin"])
def test_opening_a_run_again_and_again_does_not_slow_it_down(monkeypatch, away):
    judging = Judging(monkeypatch, first=0.5, later=0.5)
    for _ in range(700):
        judging.go_on(away, 1.0)
        opened, before = judging.now, len(judging.told)
        judging.go_on("everything", 1.0)
        # Told again what was judged last, where judging anew has to wait.
        assert judging.told[before] <= opened + STEP + 0.5
    assert judging.share() <= 0.1


def test_a_judgement_that_cannot_be_told_does_not_end_the_run(monkeypatch):
    judging = Judging(monkeypatch, first=0.1, later=0.1)
    judging.go_on("everything", 5.0)
    told = len(judging.told)
    assert told
    judging.refuses = True
    judging.go_on("everything", 5.0)
    judging.go_on("nothing", 5.0)
    judging.go_on("everything", 5.0)
    assert len(judging.told) == told


@pytest.mark.parametrize("before", ["margin", "everything"])
def test_who_watches_is_told_that_a_run_is_not_judged_any_more(monkeypatch, before):
    judging = Judging(monkeypatch, first=0.1, later=0.1)
    judging.go_on(before, 5.0)
    judging.failure = RuntimeError("the plug-in\x1b[2J broke")
    judging.go_on(before, 5.0)
    judging.go_on("nothing", 5.0)
    told = len(judging.told)
    judging.go_on("everything", 5.0)
    assert len(judging.told) == told + 1
    assert judging.last.verdicts == ()
    (line,) = judging.last.log
    assert (line.time, line.level) == (SNAPSHOT.time, "error")
    assert line.text.startswith("not judged any more while it runs: RuntimeError('the plug-in")
    assert "\x1b[" not in line.text


def test_an_error_that_cannot_say_what_it_is_does_not_end_the_run(monkeypatch):
    class WordlessError(Exception):
        def __str__(self):
            raise TypeError("an error of a plug-in may be of any class")

        __repr__ = __str__

    judging = Judging(monkeypatch, first=0.1, later=0.1)
    judging.failure = WordlessError()
    judging.go_on("everything", 5.0)
    assert judging.last.log[0].text == "not judged any more while it runs: WordlessError"
