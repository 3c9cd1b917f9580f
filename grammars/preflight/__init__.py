"""Pre-flight: what cannot work is said before a run is paid for.

:func:`check_scene` looks at a compiled scene alone, :func:`check_run` at what a robot is asked to
do in it, :func:`check_limit` at the time it has for its mission, :func:`check_map` at a map that
it is given as it is.
"""

from grammars.preflight._checked import places_of
from grammars.preflight._mission import check_limit, check_map
from grammars.preflight._run import check_run
from grammars.preflight._scene import check_scene

__all__ = [
    "check_limit",
    "check_map",
    "check_run",
    "check_scene",
    "places_of",
]
