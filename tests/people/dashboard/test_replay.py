"""A recorded run at any moment: what was recorded until then; every key of its replay."""

import math
from dataclasses import replace

import numpy as np
import pytest

from daemon.trace import TraceError
from grammars.model.robot import Mount
from scenario_tui.dashboard.playback import Playback, open_playback, render_frame, timeline_bar
from scenario_tui.dashboard.transport import next_speed
from scenario_tui.dashboard.widgets.map_frame import draw_view
from scenario_tui.text.run_text import verdict_lines
from tests.people.fake import ROBOT
from tests.people.recorded import HIT, TURNED, record_run


@pytest.fixture(scope="module")
def playback(tmp_path_factory):
    return open_playback(record_run(tmp_path_factory.mktemp("traces") / "run.mcap"))


def test_a_view_shows_what_was_recorded_until_then(playback):
    view = playback.view(4.0)
    assert view.where.x == pytest.approx(3.0)
    assert view.joints == (pytest.approx(-0.4),)
    assert view.estimate is not None
    assert view.estimate.x == pytest.approx(3.2)
    assert view.reached == 0
    assert view.trail[0] == (1.0, 2.0)
    assert view.trail[-1] == (pytest.approx(3.0), 2.0)
    assert max(x for x, _ in view.trail) <= 3.0
    assert view.plan == ((1.0, 2.0), (4.0, 2.0))
    later = playback.view(7.0)
    assert later.plan == ((4.0, 2.0), (8.0, 1.0))
    assert later.reached == 1


def test_laser_returns_stand_around_the_mount_of_the_laser(playback):
    view = playback.view(4.9)  # the last scan was at 4 s, when the robot stood at x = 3
    assert 0 < len(view.returns) <= 120
    eye = (3.0 + 0.2, 2.0)
    assert all(math.dist(eye, p) == pytest.approx(1.5, abs=1e-6) for p in view.returns)
    assert view.returns[0] == (pytest.approx(3.2), pytest.approx(0.5))


def test_returns_of_every_laser_are_shown(playback, tmp_path):
    rear = replace(ROBOT.laser, name="rear", mount=Mount(-1.0, 0.0, math.pi))
    robot = replace(ROBOT, laser=replace(ROBOT.laser, name="front"), other_lasers=(rear,))
    both = open_playback(record_run(tmp_path / "run.mcap", robot=robot)).view(4.9).returns
    front = playback.view(4.9).returns
    assert both[: len(front)] == front
    eye = (3.0 - 1.0, 2.0)
    behind = both[len(front) :]
    assert len(behind) == len(front)
    assert all(math.dist(eye, p) == pytest.approx(1.5, abs=1e-6) for p in behind)


def test_contacts_flash_for_a_moment(playback):
    assert playback.view(HIT - 0.1).contacts == ()
    assert playback.view(HIT + 0.3).contacts == ((pytest.approx(4.35), 2.0),)
    assert playback.view(HIT + 2.0).contacts == ()
    assert len(playback.view(HIT + 2.0, window=3.0).contacts) == 1
    flash = draw_view(playback.view(HIT + 0.1), 60, 20).cells()[0]
    assert ord("✱") in flash
    assert ord("✱") not in draw_view(playback.view(2.0), 60, 20).cells()[0]


def test_the_moment_that_decides_a_verdict_shows_the_object_that_does(playback):
    assert playback.view(HIT - 0.1).decisive is None
    mark = playback.view(HIT + 0.1).decisive
    assert (mark.name, mark.fails) == ("door-1.leaf", True)
    (start, end) = mark.line
    assert start == pytest.approx((4.0 + 0.35, 2.25), abs=0.1)
    assert end[1] > 3.0
    assert playback.view(HIT + 1.0).decisive is None
    turned = playback.view(TURNED).decisive
    assert (turned.name, turned.words) == ("robot", "calm −0.4 rad/s")


@pytest.mark.parametrize(
    ("text", "time"), [("3.5", 3.5), ("1e9", 10.0), ("-4", 0.0), ("calm", TURNED)]
)
def test_a_moment_is_named_by_seconds_or_oracle(playback, text, time):
    assert playback.time_of(text) == time


@pytest.mark.parametrize("text", ["nan", "clam", ""])
def test_what_is_no_moment_is_refused(playback, text):
    with pytest.raises(ValueError, match=r"neither a number of seconds nor an\W+oracle"):
        playback.time_of(text)


def test_frames_look_as_they_did(playback, golden):
    slow = next(verdict for verdict in playback.verdicts if verdict.oracle == "slow")
    texts = []
    for time, verdict, size in (
        (6.2, None, (80, 23)),
        (slow.moment, slow, (80, 23)),
        (5.0, None, (40, 10)),
        (5.0, None, (20, 6)),
    ):
        lines = render_frame(playback, time, *size, verdict=verdict)
        assert all(line.cell_len <= size[0] for line in lines)
        assert timeline_bar(playback, time, size[0]).cell_len == size[0]
        texts += [f"--- {time} s, {size}", *(line.plain.rstrip() for line in lines)]
    golden("screens/frames.txt", "\n".join([*texts, ""]))


def test_verdicts_that_do_not_fit_are_counted(playback):
    lines = [line.plain for line in verdict_lines(playback.verdicts, 0.0, most=2)]
    assert len(lines) == 2
    assert lines[1] == "and 1 more not passed, ✓ 1 pass"


def test_a_trace_without_a_robot_is_no_replay(playback, tmp_path):
    way = playback.trace.ground_truth
    nothing = replace(way, **{name: np.empty(0) for name in ("time", "x", "y", "yaw")})
    with pytest.raises(TraceError, match="no poses of the robot"):
        Playback(replace(playback.trace, ground_truth=nothing), (), {}, {})


def test_speeds_go_from_a_tenth_to_a_thousand():
    assert next_speed(3.0, 1) == 5.0
    assert next_speed(3.0, -1) == 2.0
    assert next_speed(1000.0, 1) == 1000.0
    assert next_speed(0.1, -1) == 0.1
