"""The ROS navigation stack as people run it: AMCL, costmap_2d, navfn, DWA, move_base.

Written anew from the published behaviour of the ROS 1 Noetic packages, configured by the YAML
files people already have, quirks included (:mod:`daemon.navigation.ros.quirks`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from daemon.sut import SystemUnderTest

__all__ = ["make_ros", "warm_up"]


def make_ros(parameters: Mapping[str, Any]) -> SystemUnderTest:
    """Return a fresh stack configured by a tree of ROS parameters.

    Raises ``ValueError`` (:class:`daemon.navigation.ros.parameters.ParameterError`) naming
    everything that is wrong with them.
    """
    from daemon.navigation.ros._stack import RosStack
    from daemon.navigation.ros.configuration import read_ros

    return RosStack(read_ros(parameters))


def warm_up() -> None:
    """Compile or load every kernel once, so that forked children start without compiling."""
    from daemon.navigation.ros._warmup import warm_up as run

    run()
