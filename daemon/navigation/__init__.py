"""The systems under test that ship here: ``idle``, ``pilot`` and ``ros``.

A system under test knows what :mod:`daemon.sut` gives it and no more: never the simulator.
"""

from __future__ import annotations

from daemon.navigation.pilot import PilotParameters, make_idle, make_pilot
from daemon.navigation.ros import make_ros

__all__ = ["PilotParameters", "make_idle", "make_pilot", "make_ros", "warm_up"]


def warm_up() -> None:
    """Compile or load every kernel once, so that forked children start without compiling."""
    from daemon.navigation.pilot import warm_up as warm_up_pilot
    from daemon.navigation.ros import warm_up as warm_up_ros

    warm_up_pilot()
    warm_up_ros()
