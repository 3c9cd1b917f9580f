"""A recorded run at any moment: what was recorded until then, and nothing later."""

import math
from dataclasses import replace

import numpy as np
import pytest

from daemon.trace import TraceError
from grammars.model.robot import Mount
from scenario_tui.dashboard.playback import Playback, open_playback, render_frame, timeline_bar
from scenario_tui.dashboard.transport import ReplayTransport, next_speed
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


def test_a_verdict_that_is_chosen_shows_its_own_object(playback):
    slow = next(verdict for verdict in playback.verdicts if verdict.oracle == "slow")
    mark = playback.view(slow.moment, verdict=slow).decisive
    assert (mark.name, mark.words, mark.fails) == ("robot", "slow +0.1 m/s", False)
    assert playback.view(HIT, verdict=slow).decisive is None
    frame = "\n".join(
        line.plain for line in render_frame(playback, slow.moment, 80, 23, verdict=slow)
    )
    assert "● slow +0.1 m/s" in frame
    assert "● robot decides" in frame


def test_plans_are_dotted_where_trails_are_not(playback):
    from dataclasses import replace

    view = replace(playback.view(0.0), returns=(), estimate=None)
    with_plan = draw_view(view, 80, 24).cells()[0]
    without = draw_view(replace(view, plan=()), 80, 24).cells()[0]
    assert 0 < np.count_nonzero(with_plan != without) < 3.0 / 12.4 * 80


def test_moments_are_those_oracles_were_decided_against(playback):
    assert [(m.time, m.oracle) for m in playback.moments] == [(HIT, "no-contact"), (TURNED, "calm")]


@pytest.mark.parametrize(
    ("text", "time"), [("3.5", 3.5), ("1e9", 10.0), ("-4", 0.0), ("calm", TURNED)]
)
def test_a_moment_is_named_by_seconds_or_oracle(playback, text, time):
    assert playback.time_of(text) == time


@pytest.mark.parametrize("text", ["nan", "clam", ""])
def test_what_is_no_moment_is_refused(playback, text):
    with pytest.raises(ValueError, match=r"no number of seconds and no\W+oracle"):
        playback.time_of(text)


def test_a_frame_fits_and_says_everything(playback):
    lines = [line.plain for line in render_frame(playback, 6.2, 80, 23)]
    assert len(lines) == 23
    assert max(map(len, lines)) <= 80
    assert lines[0] == "S2/pilot/0  6.2 s of 10.0 s  reached 1 of 3 waypoints"
    assert lines[1].count("✗") == 2
    assert any("✱" in line for line in lines)
    passed = lines.index("✓ 1 pass")
    assert lines[passed - 2].startswith("✗ fail  no-contact")
    assert lines[passed - 1].endswith("at 8.0 s, 1.8 s ahead")
    legend = " ".join(lines[passed + 1 :])
    assert all(words in legend for words in ("robot", "◆ waypoint", "◇ reached", "✱ contact"))


@pytest.mark.parametrize("size", [(20, 6), (40, 10), (200, 60)])
def test_a_frame_fits_into_any_terminal(playback, size):
    lines = render_frame(playback, 5.0, *size)
    assert all(line.cell_len <= size[0] for line in lines)
    assert timeline_bar(playback, 5.0, size[0]).cell_len == size[0]


def test_verdicts_that_do_not_fit_are_counted(playback):
    lines = [line.plain for line in verdict_lines(playback.verdicts, 0.0, most=2)]
    assert len(lines) == 2
    assert lines[1] == "and 1 more not passed, ✓ 1 pass"


def test_a_trace_without_a_robot_is_no_replay(playback, tmp_path):
    from dataclasses import replace

    way = playback.trace.ground_truth
    nothing = replace(way, **{name: np.empty(0) for name in ("time", "x", "y", "yaw")})
    with pytest.raises(TraceError, match="where the robot was"):
        Playback(replace(playback.trace, ground_truth=nothing), (), {}, {})


def test_time_goes_as_fast_as_the_speed_and_stops_at_the_end():
    transport = ReplayTransport(0.0, 10.0, 0.0, speed=5.0)
    assert transport.advance(1.0) == 5.0
    transport.advance(60.0)
    assert (transport.time, transport.playing) == (10.0, False)
    transport.toggle()
    assert (transport.time, transport.playing) == (0.0, True)


def test_speeds_go_from_a_tenth_to_a_thousand():
    assert next_speed(3.0, 1) == 5.0
    assert next_speed(3.0, -1) == 2.0
    assert next_speed(1000.0, 1) == 1000.0
    assert next_speed(0.1, -1) == 0.1
