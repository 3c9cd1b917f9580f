"""The ROS navigation stack as people run it: AMCL, costmap_2d, navfn, DWA, move_base.

Written anew from the published behaviour of the ROS 1 Noetic packages, configured by the YAML
files people already have, quirks included (:mod:`daemon.stacks.ros1.quirks`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from daemon.model.sut import SystemUnderTest

__all__ = ["make_ros"]


def make_ros(parameters: Mapping[str, Any]) -> SystemUnderTest:
    """Return a fresh stack configured by a tree of ROS parameters.

    Raises ``ValueError`` (:class:`daemon.stacks.ros1.parameters.ParameterError`) naming
    everything that is wrong with them.
    """
    from daemon.stacks.ros1.configuration import read_ros
    from daemon.stacks.ros1.stack import RosStack

    return RosStack(read_ros(parameters))
