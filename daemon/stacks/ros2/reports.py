"""Reports of Nav2 that a run records on request: their topics and their decoding."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, Literal

from daemon.model.stack_reports import (
    COSTMAP,
    REPORT_TOPICS,
    ReportName,
    decode_collision,
    decode_costmap,
    decode_speed_limit,
    decode_tree_log,
)
from daemon.model.sut import StackReport
from daemon.stacks.ros2.keys import Ros2Frames, Ros2Keys
from daemon.stacks.ros2.link import ReceivedMessage, TopicSetup

_TREE_DEPTH: Final = 100
"""Number of logs that may wait for a cycle; a tree ticks up to a hundred times a second."""


def report_topics(settings: Ros2Keys) -> dict[str, ReportName]:
    """Return the reports to record, by topic."""
    topics = settings.topics
    names: dict[ReportName, str] = {
        "behavior tree": topics.behavior_tree,
        "global costmap": topics.global_costmap,
        "local costmap": topics.local_costmap,
        "collision monitor": topics.collision_monitor,
        "speed limit": topics.speed_limit,
    }
    return {names[report]: report for report in settings.record}


def report_subscriptions(settings: Ros2Keys) -> Iterator[TopicSetup]:
    """Yield the subscriptions for these topics."""
    for topic, report in report_topics(settings).items():
        kind = REPORT_TOPICS[report][1]
        if report == "behavior tree":
            yield TopicSetup(topic, kind, depth=_TREE_DEPTH, keep="all")
        else:
            # Costmaps are latched, because an unchanged one is sent once, perhaps before the run.
            yield TopicSetup(topic, kind, "latched" if kind == COSTMAP else "reliable", 1)


def read_report(
    report: ReportName, message: ReceivedMessage, now: float, frames: Ros2Frames
) -> StackReport:
    """Read a report that came at ``now`` [s].

    Raises ``ValueError`` for a damaged message, and for a costmap in a frame other than those of
    the map and of odometry.
    """
    names: dict[str, Literal["map", "odom"]] = {frames.map: "map", frames.odom: "odom"}
    try:
        match report:
            case "behavior tree":
                return decode_tree_log(message.data, now)
            case "collision monitor":
                return decode_collision(message.data, now)
            case "speed limit":
                return decode_speed_limit(message.data, now)
            case "global costmap":
                return decode_costmap(message.data, now, "global", names)
            case "local costmap":
                return decode_costmap(message.data, now, "local", names)
    except ValueError:
        raise
    except Exception as error:
        # rosbags reads damaged bytes with struct, numpy and its own code.
        raise ValueError(f"a damaged {message.kind}: {error}") from error
