"""Reports of a navigation stack that a run records on request: behaviour tree, costmaps, limits.

The key ``record`` lists them by name. Their messages are those of Nav2.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import Final, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.model import ros_messages as ros
from daemon.model.sut import (
    BehaviorTreeLog,
    CollisionAction,
    CollisionMonitorState,
    CostmapPicture,
    SpeedLimit,
    StackReport,
    TreeChange,
)
from grammars.text.terminal_text import printable

TREE_LOG: Final = "nav2_msgs/msg/BehaviorTreeLog"
COLLISION: Final = "nav2_msgs/msg/CollisionMonitorState"
SPEED_LIMIT: Final = "nav2_msgs/msg/SpeedLimit"
COSTMAP: Final = "nav_msgs/msg/OccupancyGrid"

ReportName: TypeAlias = Literal[
    "behavior tree", "global costmap", "local costmap", "collision monitor", "speed limit"
]
REPORT_TOPICS: Final[dict[ReportName, tuple[str, str]]] = {
    "behavior tree": ("/behavior_tree_log", TREE_LOG),
    "global costmap": ("/global_costmap/costmap", COSTMAP),
    "local costmap": ("/local_costmap/costmap", COSTMAP),
    "collision monitor": ("/collision_monitor_state", COLLISION),
    "speed limit": ("/speed_limit", SPEED_LIMIT),
}
"""Topic and type of each report in a trace, by its name."""

_ACTIONS: Final[tuple[CollisionAction, ...]] = ("none", "stop", "slowdown", "approach", "limit")
"""Actions by their numbers in ``nav2_msgs/CollisionMonitorState``."""
_STATUSES: Final = frozenset({"IDLE", "RUNNING", "SUCCESS", "FAILURE", "SKIPPED"})
"""Statuses of BehaviorTree.CPP 3 and 4."""


class StackState:
    """Latest reports of a stack: running nodes of its tree, costmaps, limits."""

    def __init__(self) -> None:
        self._costmaps: dict[str, CostmapPicture] = {}
        self._nodes: dict[tuple[str, int], None] = {}
        self._collision: CollisionMonitorState | None = None
        self._limit: SpeedLimit | None = None

    def take(self, report: StackReport) -> None:
        """Take the next report."""
        match report:
            case BehaviorTreeLog(changes=changes):
                for change in changes:
                    self._nodes.pop((change.node, change.uid), None)
                    if change.current == "RUNNING":
                        self._nodes[change.node, change.uid] = None
            case CollisionMonitorState():
                self._collision = report
            case SpeedLimit():
                self._limit = report
            case CostmapPicture():
                self._costmaps[report.scope] = report

    @property
    def costmap(self) -> CostmapPicture | None:
        """The latest local costmap with a known pose in the map, otherwise the global one."""
        latest = (self._costmaps.get(scope) for scope in ("local", "global"))
        return next((c for c in latest if c is not None and c.frame_pose is not None), None)

    @property
    def running(self) -> tuple[str, ...]:
        """Names of the RUNNING nodes, the one that began first in front."""
        return tuple(dict.fromkeys(name for name, _ in self._nodes))

    @property
    def line(self) -> str:
        """Collision monitor, speed limit and running nodes, the latest first, for any terminal."""
        parts = []
        if self._collision is not None and self._collision.text:
            parts.append(f"collision monitor: {self._collision.text}")
        if self._limit is not None and self._limit.text:
            parts.append(f"speed limit: {self._limit.text}")
        # Last, since narrow screens cut it: a tree may have a dozen running nodes.
        if self._nodes:
            parts.append(f"running: {', '.join(reversed(self.running))}")
        return printable("  ".join(parts))


@functools.cache
def published_costs() -> npt.NDArray[np.int8]:
    """Return the published values of costs 0 to 255: 99 inscribed, 100 lethal, -1 unknown.

    Source: the cost translation table of ``costmap_2d::Costmap2DPublisher``.
    """
    costs = np.arange(256)
    # Its loop in integer arithmetic: 1 + (97 * (cost - 1)) / 251 for costs of 1 to 252.
    table = (1 + 97 * (costs - 1) // 251).astype(np.int16)
    table[[0, 253, 254, 255]] = 0, 99, 100, -1
    return table.astype(np.int8)


@functools.cache
def _least_costs() -> npt.NDArray[np.uint8]:
    """Return the least cost that is published as a value, by the value's byte (256,)."""
    costs = np.full(256, 255, np.uint8)
    for cost in range(254, -1, -1):
        costs[published_costs()[cost]] = cost
    return costs


def encode_tree_log(now: int, log: BehaviorTreeLog) -> bytes:
    """Return a ``nav2_msgs/BehaviorTreeLog`` of Jazzy and later, all its times ``now`` [ns]."""
    stamp = ros.time(now)
    events = [
        ros.make(
            "nav2_msgs/msg/BehaviorTreeStatusChange",
            timestamp=stamp,
            node_name=change.node,
            uid=change.uid,
            previous_status=change.previous,
            current_status=change.current,
        )
        for change in log.changes
    ]
    return ros.serialize(ros.make(TREE_LOG, timestamp=stamp, event_log=events), TREE_LOG)


def encode_collision(state: CollisionMonitorState) -> bytes:
    """Return a ``nav2_msgs/CollisionMonitorState``."""
    number = _ACTIONS.index(state.action)
    message = ros.make(COLLISION, action_type=number, polygon_name=state.polygon)
    return ros.serialize(message, COLLISION)


def encode_speed_limit(now: int, limit: SpeedLimit) -> bytes:
    """Return a ``nav2_msgs/SpeedLimit`` at ``now`` [ns]."""
    header = ros.header(ros.time(now), "")
    message = ros.make(
        SPEED_LIMIT, header=header, percentage=limit.percentage, speed_limit=limit.limit
    )
    return ros.serialize(message, SPEED_LIMIT)


def decode_tree_log(data: bytes, time: float) -> BehaviorTreeLog:
    """Read a ``nav2_msgs/BehaviorTreeLog`` of any distribution as one of ``time`` [s].

    Raises ``ValueError`` for anything else.
    """
    # Jazzy gave each change a uid, and no message says which form it has.
    for kind in (TREE_LOG, ros.TREE_LOG_WITHOUT_UIDS):
        try:
            events = ros.deserialize(data, kind).event_log
        except Exception:
            # Damaged bytes make rosbags raise various exceptions.
            continue
        changes = tuple(
            TreeChange(e.node_name, getattr(e, "uid", 0), e.previous_status, e.current_status)
            for e in events
        )
        if _STATUSES.issuperset(c for change in changes for c in (change.previous, change.current)):
            return BehaviorTreeLog(time, changes)
    raise ValueError("not a log of a behaviour tree")


def decode_collision(data: bytes, time: float) -> CollisionMonitorState:
    """Read a ``nav2_msgs/CollisionMonitorState``; raises for anything else, as rosbags does."""
    message = ros.deserialize(data, COLLISION)
    number = int(message.action_type)
    if number >= len(_ACTIONS):
        raise ValueError(f"action {number} of a collision monitor is unknown")
    return CollisionMonitorState(time, _ACTIONS[number], str(message.polygon_name))


def decode_speed_limit(data: bytes, time: float) -> SpeedLimit:
    """Read a ``nav2_msgs/SpeedLimit``; raises for anything else, as rosbags does."""
    message = ros.deserialize(data, SPEED_LIMIT)
    return SpeedLimit(time, float(message.speed_limit), bool(message.percentage))


def decode_costmap(
    data: bytes,
    time: float,
    scope: Literal["local", "global"],
    frames: Mapping[str, Literal["map", "odom"]],
) -> CostmapPicture:
    """Read a ``nav_msgs/OccupancyGrid`` as a costmap of ``time`` [s].

    ``frames`` are the map and odom frame by their names. Raises ``ValueError`` for other frames and
    sizes, and the exceptions of rosbags for anything else.
    """
    grid = ros.deserialize(data, COSTMAP)
    frame, info = grid.header.frame_id.lstrip("/"), grid.info
    if frame not in frames:
        raise ValueError(f"it is in frame {frame!r}, not in {' or '.join(frames)}")
    corner = info.origin.position
    place = (float(info.resolution), float(corner.x), float(corner.y))
    if not all(map(math.isfinite, place)) or info.width * info.height != len(grid.data):
        raise ValueError("the number of its cells contradicts its size")
    cells = _least_costs()[grid.data.view(np.uint8)].reshape(info.height, info.width)
    return CostmapPicture(time, frames[frame], *place, cells, scope)
