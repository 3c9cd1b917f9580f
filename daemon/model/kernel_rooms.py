"""Where the kernels are that a run calls: what the first run on a machine has to compile.

Rooms are packages and modules that have a ``warm_up``, known by their names: who asks, a worker for
each run it begins, loads none of them and no compiler.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

RUN_ROOMS: Final = ("daemon.simulator", "daemon.judging.oracles")
"""The rooms that every run enters."""
_PILOT: Final = "daemon.stacks.pilot"
_ROS: Final = "daemon.stacks.ros1"
_ALWAYS: Final = ("stack", "amcl", "costmap", "move_base")
# The first of each is what move_base takes when nothing is written.
_GLOBAL: Final = {"navfn/NavfnROS": "navfn", "global_planner/GlobalPlanner": "global_planner"}
_LOCAL: Final = {
    "base_local_planner/TrajectoryPlannerROS": "trajectory_planner",
    "dwa_local_planner/DWAPlannerROS": "dwa",
}
SYSTEM_ROOMS: Final = (
    _PILOT,
    *(f"{_ROS}.{name}" for name in (*_ALWAYS, *_GLOBAL.values(), *_LOCAL.values())),
)
"""All rooms of the systems under test that ship here."""


def kernel_rooms(kind: str, parameters: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the rooms of a run whose system under test is of ``kind`` with these ``parameters``.

    A system that plugs in has none. Parameters are not checked here: kernels of a room that is left
    out are compiled by the run that calls them.
    """
    if kind == "pilot":
        return (*RUN_ROOMS, _PILOT)
    if kind != "ros":
        return RUN_ROOMS
    given = parameters.get("move_base")
    move_base = given if isinstance(given, Mapping) else {}
    names = [
        *_ALWAYS,
        _chosen(move_base.get("base_global_planner"), _GLOBAL),
        _chosen(move_base.get("base_local_planner"), _LOCAL),
    ]
    return (*RUN_ROOMS, *(f"{_ROS}.{name}" for name in names))


def _chosen(name: object, planners: Mapping[str, str]) -> str:
    usual = next(iter(planners.values()))
    return planners.get(name, usual) if isinstance(name, str) else usual
