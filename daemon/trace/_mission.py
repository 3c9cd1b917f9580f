"""The mission on the wire: progress as ``action_msgs/GoalStatusArray`` and back.

One goal per waypoint in mission order, then one for the mission as a whole. Waypoints that are
reached are SUCCEEDED, the current one EXECUTING (ABORTED when the mission is), later ones
ACCEPTED. Goal ids are UUIDs of version 5 over the run's digest, so they are the same every time.
"""

from __future__ import annotations

import uuid
from typing import Any, Final, Literal

import numpy as np

from daemon.model.sut import Progress
from daemon.trace import messages as ros
from grammars.model.mission import Mission, Waypoint

STATUS: Final = "action_msgs/msg/GoalStatusArray"
# action_msgs/GoalStatus: STATUS_ACCEPTED, STATUS_EXECUTING, STATUS_SUCCEEDED, STATUS_ABORTED.
_ACCEPTED, _EXECUTING, _SUCCEEDED, _ABORTED = 1, 2, 4, 6
_STATES: Final[dict[int, Literal["active", "succeeded", "aborted"]]] = {
    _EXECUTING: "active",
    _SUCCEEDED: "succeeded",
    _ABORTED: "aborted",
}
_CODES: Final = {state: code for code, state in _STATES.items()}


def goal_ids(run: str, mission: Mission) -> tuple[Any, ...]:
    """Return the UUID messages of all waypoints and of the mission, for the run's digest."""
    names = [*(f"{i}/{w.id}" for i, w in enumerate(mission.waypoints)), "mission"]
    found = (uuid.uuid5(uuid.NAMESPACE_URL, f"run:{run}/goal/{name}").bytes for name in names)
    kind = "unique_identifier_msgs/msg/UUID"
    return tuple(ros.make(kind, uuid=np.frombuffer(raw, np.uint8)) for raw in found)


def status(goals: tuple[Any, ...], progress: Progress) -> Any:
    """Return the status of all goals."""
    if progress.state not in _CODES:
        raise ValueError(f"a mission is {', '.join(_CODES)}, not {progress.state!r}")
    count = len(goals) - 1
    reached = min(max(progress.reached, 0), count)
    codes = [_SUCCEEDED] * reached + [_ACCEPTED] * (count - reached)
    current = max(progress.current, reached)
    if current < count and progress.state != "succeeded":
        codes[current] = _CODES[progress.state]
    codes.append(_CODES[progress.state])
    return ros.make(
        STATUS,
        status_list=[
            ros.make(
                "action_msgs/msg/GoalStatus",
                goal_info=ros.make("action_msgs/msg/GoalInfo", goal_id=goal, stamp=ros.time(0)),
                status=code,
            )
            for goal, code in zip(goals, codes, strict=True)
        ],
    )


def progress(message: Any) -> Progress:
    """Return the progress a status message stands for; raises ``ValueError`` when none."""
    codes = [int(goal.status) for goal in message.status_list]
    if not codes or codes[-1] not in _STATES:
        raise ValueError("a mission status without the mission's own goal")
    waypoints = codes[:-1]
    reached = waypoints.count(_SUCCEEDED)
    here = [i for i, code in enumerate(waypoints) if code in (_EXECUTING, _ABORTED)]
    return Progress(here[0] if here else reached, reached, _STATES[codes[-1]])


def goal(waypoint: Waypoint, stamp: int) -> Any:
    """Return the current waypoint as a ``geometry_msgs/PoseStamped``."""
    return ros.make(
        "geometry_msgs/msg/PoseStamped",
        header=ros.header(ros.time(stamp), "map"),
        pose=ros.pose(waypoint.x, waypoint.y, *ros.yaw_quaternion(waypoint.yaw or 0.0)),
    )
