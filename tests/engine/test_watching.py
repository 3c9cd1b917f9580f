"""What watchers see of a run, when it is judged for them, and that the run does not notice."""

import math
import random
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from daemon.batch.client import read_snapshot
from daemon.model.live_view import (
    MOST_BLOCKED,
    MOST_PLAN_POINTS,
    MOST_RETURNS,
    LiveView,
    from_centimetres,
    to_centimetres,
)
from daemon.model.spec import Snapshot
from daemon.model.status import LiveSnapshot
from daemon.model.sut import CostmapPicture, Estimate
from daemon.model.verdicts import Outcome
from daemon.run_judge import WatchedRun
from grammars.model.geometry import Pose2
from grammars.model.robot import Laser, Mount
from grammars.text import codec
from tests.engine.judging.traces import along, answers, cut, make_trace, mission, times

LASER = Laser(Mount(0.5), 0.3, -np.pi / 2, np.pi / 2, 181, 0.05, 10.0, 10.0, 0.01, 0.0)
BARE = Snapshot(1.0, 10.0, Pose2(1.0, 2.0), None, 0, 1, ())


def test_points_keep_to_the_centimetre():
    points = np.array([(1.234, -5.678), (0.0, 12.0), (np.nan, 1.0)])
    assert from_centimetres(to_centimetres(points)) == ((1.23, -5.68), (0.0, 12.0))
    assert from_centimetres((100, 200, 300)) == ((1.0, 2.0),)


def test_returns_lie_where_a_laser_saw_something_and_share_what_a_snapshot_takes():
    rear = replace(LASER, name="rear", mount=Mount(0, 0, np.pi))
    view, ranges = LiveView((replace(LASER, name="front"), rear)), np.full(181, np.inf)
    ranges[90] = 2.0  # straight ahead
    view.add_scan(Pose2(1.0, 2.0, np.pi / 2), ranges, "front")
    assert from_centimetres(view.extend(BARE, None, None, None).returns) == ((1.0, 4.5),)
    for name, distance in (("front", 3.0), ("rear", 2.0)):
        view.add_scan(Pose2(), np.full(181, distance), name)
    seen = from_centimetres(view.extend(BARE, None, None, None).returns)
    assert 2 < len(seen) <= MOST_RETURNS
    assert (min(x for x, _ in seen), max(x for x, _ in seen)) == (-2.0, 3.5)


def test_everything_is_thinned_and_contacts_are_told_once():
    view = LiveView((LASER,))
    view.add_scan(Pose2(), np.full(181, 3.0))
    view.contacts.append((1.0, 2.0))
    plan = np.column_stack([np.linspace(0.0, 50.0, 5000), np.zeros(5000)])
    belief = Estimate(1.0, Pose2(), np.diag([0.04, 0.01, 0.1]))
    cells = np.full((60, 60), 254, np.uint8)
    costmap = CostmapPicture(1.0, "odom", 0.05, 40.0, 40.0, cells, frame_pose=Pose2(1.0, 0.0))
    line = replace(BARE, stack="x" * 120)
    picture = view.extend(line, belief, plan, costmap)
    assert len(picture.costmap) == 2 * MOST_BLOCKED
    assert from_centimetres(picture.costmap)[0] == (41.02, 40.02)
    assert len(picture.returns) <= 2 * MOST_RETURNS
    assert len(picture.plan) == 2 * MOST_PLAN_POINTS
    assert from_centimetres(picture.plan)[-1] == (50.0, 0.0)
    assert from_centimetres(picture.contacts) == ((1.0, 2.0),)
    assert picture.spread == (0.04, 0.0, 0.01)
    assert view.extend(BARE, belief, plan, None).contacts == ()
    assert len(codec.to_json(LiveSnapshot("r" * 60, picture))) < 4000


@pytest.mark.parametrize("variance", [1e200, np.inf, np.nan])
def test_a_belief_that_cannot_be_told_leaves_the_rest_to_be_seen(variance):
    belief = Estimate(1.0, Pose2(), np.diag([variance, 0.01, 0.1]))
    picture = LiveView((LASER,)).extend(BARE, belief, np.array([(1.0, 2.0)]), None)
    live = LiveSnapshot("c.0", picture)
    assert read_snapshot(codec.to_json(live)) == live
    assert (picture.spread, picture.plan) == (None, (100, 200))


@pytest.fixture(scope="module")
def alone(runs, tmp_path_factory):
    """A run of three seconds that nobody watches: its result and its recording."""
    path = tmp_path_factory.mktemp("alone") / "run.mcap"
    return runs.execute(runs.spec(limit=3.0), path), path.read_bytes()


@pytest.fixture
def watched(runs, tmp_path):
    """Execute that run for somebody who watches."""

    def execute(limit=3.0, interest="everything", judgements=None):
        spec = runs.spec(limit=limit)
        seen, path = [], tmp_path / "watched.mcap"
        result = runs.execute(
            spec, path, on_progress=seen.append, interest=lambda: interest, judgements=judgements
        )
        return result, seen

    return execute


@pytest.mark.parametrize("interest", ["nothing", "progress", "everything"])
def test_who_watches_changes_nothing(alone, tmp_path, watched, interest):
    result, seen = watched(interest=interest)
    assert result.digest == alone[0].digest
    assert (tmp_path / "watched.mcap").read_bytes() == alone[1]
    assert len(seen) == (0 if interest == "nothing" else 31)
    assert any(s.returns and s.spread and s.plan for s in seen) == (interest == "everything")


class Judged:
    """Wants everything, always, and keeps it."""

    def __init__(self, scope="everything"):
        self.found = []
        self._scope = scope

    def scope(self):
        return self._scope

    def tell(self, judgement):
        self.found.append(judgement)


def test_who_has_it_judged_changes_nothing_and_is_told_the_verdicts(alone, monkeypatch, watched):
    # Judged with every snapshot, where it otherwise takes a tenth of the time.
    monkeypatch.setattr("daemon.run_judge._PERIOD", 0.0)
    monkeypatch.setattr("daemon.run_judge._SHARE", 1e9)
    judged = Judged()
    result, seen = watched(judgements=judged)
    assert result.digest == alone[0].digest
    assert result.trace.sha256 == alone[0].trace.sha256
    assert len(judged.found) == len(seen) + 1
    assert [one.time for one in judged.found[:-1]] == pytest.approx([s.time for s in seen])
    assert judged.found[-1].verdicts == result.verdicts
    outcomes = {verdict.oracle: verdict.outcome for verdict in result.verdicts}
    for judgement in judged.found:
        for one in judgement.verdicts:
            assert one.outcome is not Outcome.FAIL or outcomes[one.oracle] is Outcome.FAIL
    assert seen[0].margin is None
    assert seen[-1].margin is not None
    assert seen[-1].oracle in outcomes


def test_margins_of_all_runs_are_found_without_a_judgement(watched):
    judged = Judged("margin")
    _, seen = watched(interest="progress", judgements=judged)
    assert judged.found == []
    assert seen[0].margin is None
    assert {(s.oracle, s.unit) for s in seen[1:]} == {(seen[1].oracle, seen[1].unit)}
    assert seen[1].margin is not None


def test_a_judge_that_fails_fails_alone(watched, monkeypatch, capfd):
    monkeypatch.setattr("daemon.judging.live.sample_run_signals", lambda sampler: 1 / 0)
    judged = Judged()
    result, _ = watched(judgements=judged)
    assert result.ended == "limit"
    (told,) = judged.found
    assert told.verdicts == ()
    assert "not judged any more" in told.log[0].text
    assert capfd.readouterr().err.count("ZeroDivisionError") == 1


def test_judges_that_draw_leave_the_same_chance_to_the_run(watched, monkeypatch):
    def draw(sampler):
        random.random()
        np.random.rand()
        return ()

    monkeypatch.setattr("daemon.judging.live.sample_run_signals", draw)
    judged = Judged()
    random.seed(1)
    np.random.seed(1)
    expected = random.Random(1).random(), np.random.RandomState(1).rand()
    watched(1.0, judgements=judged)
    assert judged.found
    assert (random.random(), np.random.rand()) == expected


STEP = 0.25
"""Seconds between two snapshots."""


class Judging:
    """A run whose judgements take as long as is said, on a clock of its own."""

    def __init__(self, monkeypatch, first, later):
        self.now = self._began = 100.0
        self.told = []
        self.costs = []
        self._first, self._later = first, later
        self._scope = "nothing"
        self.refuses = False
        self.failure = None
        self._trace = cut(make_trace(along(times(4.0)), goal=mission((5.0, 0.0))), 4.0)
        clock = SimpleNamespace(perf_counter=lambda: self.now)
        monkeypatch.setattr("daemon.run_judge.time", clock)
        self._run = WatchedRun(self, lambda _: None, self)

    def so_far(self, ended, note):
        if self.failure is not None:
            raise self.failure
        self.costs.append(self._first if not self.costs else self._later)
        self.now += self.costs[-1]
        return self._trace

    def scope(self):
        return self._scope

    def tell(self, judgement):
        if self.refuses:
            raise UnicodeEncodeError("utf-8", "\ud800", 0, 1, "what a plug-in says")
        self.told.append(self.now)
        self.last = judgement

    def share(self):
        """Return how much of the run's time judging took: the first is free, two may be owed."""
        return sum(self.costs[3:]) / (self.now - self._began)

    def go_on(self, scope, seconds):
        """Let the run go on for so long in that scope of judging."""
        self._scope = scope
        end = self.now + seconds
        while self.now < end:
            self._run(BARE)
            self.now += STEP


def test_judging_keeps_to_its_share_and_tells_who_opens_a_run_within_a_second(golden, monkeypatch):
    """``judging.txt`` has what the first judgement and the later ones cost, and who watches."""

    def told(costs, line):
        judging, waits = Judging(monkeypatch, *costs), []
        times, _, steps = line.rpartition(" × ")
        for step in steps.split(", ") * int(times or 1):
            scope, seconds = step.removesuffix(" s").split(" for ")
            opened, before = judging.now, len(judging.told)
            judging.go_on(scope, float(seconds))
            if scope == "everything":
                waits.append([time - opened for time in judging.told[before:]])
        first, second = max(wait[0] for wait in waits), [wait[1] for wait in waits if wait[1:]]
        return (
            f"told after {first:.2f} s and {max(second, default=math.nan):.2f} s at the latest, "
            f"{len(judging.costs)} judgements, {judging.share():.1%} of the time"
        )

    def costs(name):
        return [float(word.removesuffix(" s")) for word in name.split(", then ")]

    golden("judging.txt", answers(Path(__file__).with_name("judging.txt"), costs, told))


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
    assert (line.time, line.level) == (BARE.time, "error")
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
