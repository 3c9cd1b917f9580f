"""Reports of a Nav2 in a replay and in a watched run: costmaps on the map, the rest in a line."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.model.spec import Snapshot, SutReference
from daemon.model.stack_reports import REPORT_TOPICS, StackState
from daemon.model.sut import (
    BehaviorTreeLog,
    CollisionMonitorState,
    CostmapPicture,
    SpeedLimit,
    TreeChange,
)
from grammars.model.geometry import Pose2
from scenario_tui.dashboard.live_run import live_text, tracked_view
from scenario_tui.dashboard.playback import Playback
from scenario_tui.dashboard.run_watch import Track
from scenario_tui.dashboard.screens.replay import ReplayScreen
from scenario_tui.dashboard.screens.standalone import StandaloneApp
from scenario_tui.dashboard.widgets.map_frame import draw_view
from scenario_tui.dashboard.widgets.map_style import Layer
from scenario_tui.dashboard.widgets.top_view import TopView
from tests.engine.judging.traces import along, make_trace, times, track

CELLS = np.array([[253, 254, 255], [0, 252, 0]], np.uint8)
REPORTS = (
    BehaviorTreeLog(
        1.0,
        (
            TreeChange("NavigateRecovery", 1, "IDLE", "RUNNING"),
            TreeChange("FollowPath", 2, "IDLE", "RUNNING"),
        ),
    ),
    CollisionMonitorState(2.0, "stop", "Front"),
    SpeedLimit(2.0, 0.4, False),
    BehaviorTreeLog(3.0, (TreeChange("FollowPath", 2, "RUNNING", "FAILURE"),)),
    CollisionMonitorState(3.0, "none", ""),
    SpeedLimit(3.0, 0.0, False),
)


def playback(record=(*REPORT_TOPICS,)):
    """Of a robot that drives along x and believes to be 1 m to the left of where it is."""
    time = times(10.0)
    motion = along(time)
    trace = make_trace(motion, estimate=track(time, motion.x, 1.0), reports=REPORTS)
    costmaps = (
        CostmapPicture(0.0, "map", 0.5, 6.0, 0.0, CELLS, "global"),
        CostmapPicture(2.0, "odom", 0.5, 2.0, 0.0, CELLS),
    )
    sut = SutReference("nav2", "ros2", {"record": list(record)})
    return Playback(
        replace(trace, costmaps=costmaps, spec=replace(trace.spec, sut=sut)), (), {}, {}
    )


def test_a_line_says_what_the_stack_reported_last():
    found = playback()
    assert [found.stack_line(time) for time in (0.5, 1.0, 2.5, 3.0)] == [
        "",
        "running: FollowPath, NavigateRecovery",
        "collision monitor: stop by Front  speed limit: 0.4 m/s  "
        "running: FollowPath, NavigateRecovery",
        "running: NavigateRecovery",
    ]


def test_costmaps_lie_where_the_robot_believed_to_be():
    found = playback()
    assert list(found.view(1.0).costmaps) == ["global"]
    local = found.view(4.0).costmaps["local"]
    assert np.asarray(local) == pytest.approx(np.array([[2.25, 1.25], [2.75, 1.25]]))
    assert found.view(4.0).costmaps["global"][:, 0].tolist() == [6.25, 6.75]


def test_the_costmap_is_seen_where_it_was_asked_for():
    asked, other = playback().view(4.0), playback(()).view(4.0)
    assert Layer.COSTMAP in draw_view(asked, 80, 24).layers
    assert Layer.COSTMAP not in draw_view(asked, 80, 24, costmap="").layers
    assert Layer.COSTMAP not in draw_view(other, 80, 24).layers
    assert Layer.COSTMAP in draw_view(other, 80, 24, costmap="local").layers


async def test_a_key_shows_the_other_costmap_or_none(dashboard):
    screen = ReplayScreen(playback(), 2.5, clock=lambda: 0.0)
    dash = await dashboard(StandaloneApp(screen), (100, 30))
    assert "collision monitor: stop by Front" in dash.text
    assert "⠿⠿ blocked in the costmap" in dash.text
    await dash.press("O")
    top = dash.one(TopView)
    assert [top.next_costmap() for _ in range(3)] == ["", "local", "global"]


def test_a_watched_run_shows_its_costmap_and_the_line():
    seen = Snapshot(1.0, 9.0, Pose2(), None, 0, 1, (), costmap=(200, 100), stack="running: Spin")
    assert live_text(Track(seen), 0.0, wide=True).plain.endswith("running: Spin")
    view = playback().view(1.0)
    found = tracked_view(view.scene, playback().trace.spec, Track(seen))
    assert found.costmaps == {"stack's": ((2.0, 1.0),)}


def test_names_of_a_stack_can_be_shown_on_any_terminal():
    state = StackState()
    state.take(CollisionMonitorState(0.0, "stop", "Fro\x1b[31mnt"))
    assert "\x1b" not in state.line
    assert "stop by Fro" in state.line


def test_a_local_costmap_is_shown_once_its_place_is_known():
    """The first one comes before the stack knows where it is."""
    state = StackState()
    for scope, pose, expected in (
        ("global", Pose2(), "global"),
        ("local", None, "global"),
        ("local", Pose2(1.0, 2.0), "local"),
    ):
        state.take(CostmapPicture(0.0, "map", 0.5, 0.0, 0.0, CELLS, scope, pose))
        assert state.costmap is not None
        assert state.costmap.scope == expected
