"""ROS 2 stacks of their users, as they start them, in lock step with the simulation.

What talks to a stack is a link (:mod:`daemon.stacks.ros2.link`): a relay that runs in the stack's
own ROS 2, or a participant that speaks ``rmw_zenoh``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from daemon.model.attachments import resolve_paths

if TYPE_CHECKING:
    from daemon.model.sut import SystemUnderTest

__all__ = ["make_ros2"]


def make_ros2(parameters: Mapping[str, Any]) -> SystemUnderTest:
    """Return a stack that is started once a run begins; raises ``ValueError`` for parameters."""
    # Nobody who tests another stack pays for what talks to this one.
    from daemon.stacks.ros2.settings import read_settings
    from daemon.stacks.ros2.stack import Ros2Stack

    return Ros2Stack(read_settings(resolve_paths(parameters)))
