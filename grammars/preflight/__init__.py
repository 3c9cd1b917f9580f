"""Pre-flight checks, which report problems before a run costs time.

:func:`check_scene` checks a compiled scene, :func:`check_run` the task of a robot in it,
:func:`check_robot` the robot's values, :func:`check_limit` the time limit of a mission,
:func:`check_map` a given map.
"""

from grammars.preflight._checked import places_of
from grammars.preflight._mission import check_limit, check_map
from grammars.preflight._robot import check_robot
from grammars.preflight._run import check_run
from grammars.preflight._scene import check_scene

__all__ = [
    "check_limit",
    "check_map",
    "check_robot",
    "check_run",
    "check_scene",
    "places_of",
]
