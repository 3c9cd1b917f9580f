"""The systems under test that ship here: ``idle``, ``pilot``, ``ros`` and ``ros2``.

A system under test knows what :mod:`daemon.model.sut` gives it and no more: never the simulator.
"""

from __future__ import annotations

from daemon.stacks.pilot import PilotParameters, make_idle, make_pilot
from daemon.stacks.ros1 import make_ros

__all__ = ["PilotParameters", "make_idle", "make_pilot", "make_ros", "warm_up"]


def warm_up() -> None:
    """Compile or load every kernel once, so that forked children start without compiling."""
    from daemon.stacks.pilot import warm_up as warm_up_pilot
    from daemon.stacks.ros1 import warm_up as warm_up_ros

    warm_up_pilot()
    warm_up_ros()
