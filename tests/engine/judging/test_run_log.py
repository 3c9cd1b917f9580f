"""Lines of a run's log that its stack's reports become."""

from dataclasses import replace

from daemon.judging.run_log import run_log
from daemon.model.sut import BehaviorTreeLog, CollisionMonitorState, SpeedLimit, TreeChange
from tests.engine.judging.oracles.traces import along, make_trace, times


def test_recoveries_failed_nodes_interventions_and_limits_are_told():
    reports = (
        BehaviorTreeLog(
            1.0,
            (
                TreeChange("FollowPath", 1, "IDLE", "RUNNING"),
                TreeChange("GoalUpdated", 2, "IDLE", "FAILURE"),
            ),
        ),
        BehaviorTreeLog(
            2.0,
            (
                TreeChange("FollowPath", 1, "RUNNING", "FAILURE"),
                TreeChange("Spin", 3, "IDLE", "RUNNING"),
            ),
        ),
        CollisionMonitorState(3.0, "approach", "Footprint"),
        SpeedLimit(4.0, 0.25, False),
        CollisionMonitorState(5.0, "none", ""),
        SpeedLimit(6.0, 0.0, False),
    )
    trace = replace(make_trace(along(times(10.0))), reports=reports)
    assert [(line.time, line.level, f"{line.source}: {line.text}") for line in run_log(trace)] == [
        (2.0, "info", "behavior tree: FollowPath failed"),
        (2.0, "warn", "behavior tree: Spin begins"),
        (3.0, "info", "collision monitor: approach by Footprint"),
        (4.0, "info", "speed limit: 0.25 m/s"),
        (5.0, "info", "collision monitor: no action"),
        (6.0, "info", "speed limit: none"),
    ]
