"""What watchers see of a run, and that the run does not notice."""

import json
import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from daemon.batch.client import read_snapshot
from daemon.campaign import expand, load_campaign
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
from daemon.run import execute
from grammars.model.geometry import Pose2
from grammars.model.robot import Laser, Mount
from grammars.text import codec

CAMPAIGN = Path(__file__).parents[2] / "campaigns" / "demo" / "campaign.yaml"
LASER = Laser(Mount(0.5), 0.3, -np.pi / 2, np.pi / 2, 181, 0.05, 10.0, 10.0, 0.01, 0.0)
BARE = Snapshot(1.0, 10.0, Pose2(1.0, 2.0), None, 0, 1, ())


def test_points_keep_to_the_centimetre():
    points = np.array([(1.234, -5.678), (0.0, 12.0), (np.nan, 1.0)])
    assert from_centimetres(to_centimetres(points)) == ((1.23, -5.68), (0.0, 12.0))
    assert from_centimetres((100, 200, 300)) == ((1.0, 2.0),)


def test_returns_lie_where_the_laser_saw_something():
    view = LiveView((LASER,))
    ranges = np.full(181, np.inf)
    ranges[90] = 2.0  # straight ahead
    view.add_scan(Pose2(1.0, 2.0, np.pi / 2), ranges)
    seen = from_centimetres(view.extend(BARE, None, None, None).returns)
    assert seen == ((1.0, 4.5),)


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


def test_snapshots_of_before_are_still_read():
    data = json.loads(codec.to_json(LiveSnapshot("run", BARE)))
    for name in ("spread", "returns", "plan", "contacts"):
        del data["snapshot"][name]
    assert codec.from_plain(LiveSnapshot, data).snapshot == BARE


@pytest.mark.parametrize("interest", ["nothing", "progress", "everything"])
def test_who_watches_changes_nothing(tmp_path, interest):
    campaign = expand(load_campaign(CAMPAIGN))
    spec = replace(campaign.specs[0], limit=3.0)
    scene = next(s for s in campaign.scenes if s.digest == spec.scene)
    alone = execute(spec, scene, trace_path=tmp_path / "alone.mcap")
    seen = []
    watched = execute(
        spec, scene, trace_path=tmp_path / "watched.mcap", on_progress=seen.append,
        interest=lambda: interest,
    )  # fmt: skip
    assert watched.digest == alone.digest
    assert (tmp_path / "watched.mcap").read_bytes() == (tmp_path / "alone.mcap").read_bytes()
    assert len(seen) == (0 if interest == "nothing" else 31)
    assert any(s.returns and s.spread and s.plan for s in seen) == (interest == "everything")


def test_returns_of_all_lasers_share_what_a_snapshot_takes():
    front, rear = (
        replace(LASER, name="front"),
        replace(LASER, name="rear", mount=Mount(0, 0, np.pi)),
    )
    view = LiveView((front, rear))
    view.add_scan(Pose2(), np.full(181, 3.0), "front")
    assert 0 < len(view.extend(BARE, None, None, None).returns) <= MOST_RETURNS
    view.add_scan(Pose2(), np.full(181, 2.0), "rear")
    seen = from_centimetres(view.extend(BARE, None, None, None).returns)
    assert len(seen) <= MOST_RETURNS
    assert min(x for x, _ in seen) == -2.0
    assert max(x for x, _ in seen) == 3.5


class Judged:
    """Wants everything, always, and keeps it."""

    def __init__(self, wanted="everything"):
        self.found = []
        self._wanted = wanted

    def wanted(self):
        return self._wanted

    def tell(self, judgement):
        self.found.append(judgement)


@pytest.mark.parametrize("limit", [12.0, 3.0])
def test_who_has_it_judged_changes_nothing_and_is_told_the_verdicts(tmp_path, monkeypatch, limit):
    # Judged with every snapshot, where it otherwise takes a tenth of the time.
    monkeypatch.setattr("daemon.run_judge._PERIOD", 0.0)
    monkeypatch.setattr("daemon.run_judge._SHARE", 1e9)
    campaign = expand(load_campaign(CAMPAIGN))
    spec = replace(campaign.specs[0], limit=limit)
    scene = next(s for s in campaign.scenes if s.digest == spec.scene)
    alone = execute(spec, scene, trace_path=tmp_path / "alone.mcap")
    seen = []
    judged = Judged()
    watched = execute(
        spec, scene, trace_path=tmp_path / "watched.mcap", on_progress=seen.append,
        interest=lambda: "everything", judgements=judged,
    )  # fmt: skip
    assert watched.digest == alone.digest
    assert watched.trace.sha256 == alone.trace.sha256
    assert len(judged.found) == len(seen) + 1
    assert [one.time for one in judged.found[:-1]] == pytest.approx([s.time for s in seen])
    last = judged.found[-1]
    assert last.verdicts == watched.verdicts
    outcomes = {verdict.oracle: verdict.outcome for verdict in watched.verdicts}
    for judgement in judged.found:
        for one in judgement.verdicts:
            assert one.outcome is not Outcome.FAIL or outcomes[one.oracle] is Outcome.FAIL
    assert seen[0].margin is None
    assert seen[-1].margin is not None
    assert seen[-1].oracle in outcomes


def test_margins_of_all_runs_are_found_without_a_judgement(tmp_path):
    campaign = expand(load_campaign(CAMPAIGN))
    spec = replace(campaign.specs[0], limit=3.0)
    scene = next(s for s in campaign.scenes if s.digest == spec.scene)
    seen = []
    judged = Judged("margin")
    execute(
        spec, scene, trace_path=tmp_path / "run.mcap", on_progress=seen.append,
        interest=lambda: "progress", judgements=judged,
    )  # fmt: skip
    assert judged.found == []
    assert seen[0].margin is None
    assert {(s.oracle, s.unit) for s in seen[1:]} == {(seen[1].oracle, seen[1].unit)}


def test_a_judge_that_fails_fails_alone(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr("daemon.judging.live.sample_run_signals", lambda sampler: 1 / 0)
    campaign = expand(load_campaign(CAMPAIGN))
    spec = replace(campaign.specs[0], limit=3.0)
    scene = next(s for s in campaign.scenes if s.digest == spec.scene)
    judged = Judged()
    result = execute(
        spec, scene, trace_path=tmp_path / "run.mcap", on_progress=lambda _: None,
        interest=lambda: "everything", judgements=judged,
    )  # fmt: skip
    assert result.ended == "limit"
    (told,) = judged.found
    assert told.verdicts == ()
    assert "not judged any more" in told.log[0].text
    assert capfd.readouterr().err.count("ZeroDivisionError") == 1


def test_judges_that_draw_leave_the_same_chance_to_the_run(tmp_path, monkeypatch):
    def draw(sampler):
        random.random()
        np.random.rand()
        return ()

    monkeypatch.setattr("daemon.judging.live.sample_run_signals", draw)
    campaign = expand(load_campaign(CAMPAIGN))
    spec = replace(campaign.specs[0], limit=1.0)
    scene = next(s for s in campaign.scenes if s.digest == spec.scene)
    judged = Judged()
    random.seed(1)
    np.random.seed(1)
    expected = random.Random(1).random(), np.random.RandomState(1).rand()
    execute(
        spec, scene, trace_path=tmp_path / "run.mcap", on_progress=lambda _: None,
        interest=lambda: "everything", judgements=judged,
    )  # fmt: skip
    assert judged.found
    assert (random.random(), np.random.rand()) == expected
