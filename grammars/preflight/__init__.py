"""Pre-flight: what cannot work is said before a run is paid for.

:func:`check_world` looks at a compiled scene alone, :func:`check_run` at what a robot is asked to
do in it.
"""

from grammars.preflight.free_space import inscribed_radius
from grammars.preflight.places import places_of
from grammars.preflight.run import check_run
from grammars.preflight.world import check_world

__all__ = ["check_run", "check_world", "inscribed_radius", "places_of"]
