"""The small stack that ships with the project: ``pilot``, and ``idle`` that does nothing.

The pilot is a small honest stack: scan matching on the map's signed distance field fused with
odometry, A* with any-angle shortcuts, a layer of obstacles the map does not show, pure pursuit
behind a guard that sweeps the footprint. It knows what :mod:`daemon.model.sut` gives it and no
more.
"""

from __future__ import annotations

from collections.abc import Mapping

from daemon.model.sut import SystemUnderTest
from daemon.stacks.pilot._parameters import PilotParameters, read_parameters
from daemon.stacks.pilot._pilot import Idle, Pilot

__all__ = ["PilotParameters", "make_idle", "make_pilot", "top_speed", "warm_up"]


def make_pilot(parameters: Mapping[str, object]) -> SystemUnderTest:
    """Return a fresh pilot; raises ``ValueError`` for parameters it does not take."""
    return Pilot(read_parameters(parameters))


def top_speed(parameters: Mapping[str, object]) -> float:
    """Return how fast the pilot drives along an axis of a robot at most [m/s].

    Raises ``ValueError`` for parameters it does not take.
    """
    return read_parameters(parameters).max_speed


def make_idle(parameters: Mapping[str, object]) -> SystemUnderTest:
    """Return a system that never moves; raises ``ValueError`` for any parameter."""
    if parameters:
        names = ", ".join(f'"{name}"' for name in parameters)
        raise ValueError(f"the idle system takes no parameters, given: {names}")
    return Idle()


def warm_up() -> None:
    """Compile or load every kernel once, so that forked children start without compiling."""
    from daemon.stacks.pilot._pilot import warm_up as run

    run()
