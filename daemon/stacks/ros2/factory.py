"""Makes a stack of what its SUT file says; nothing is started before a run begins."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from daemon.model.attachments import SutMissing
from daemon.model.execution import commands_allowed

if TYPE_CHECKING:
    from daemon.model.sut import SystemUnderTest


def make_ros2(parameters: Mapping[str, Any]) -> SystemUnderTest:
    """Return a stack that is started once a run begins; raises ``ValueError`` for parameters.

    Raises :class:`~daemon.model.attachments.SutMissing` where commands of SUT files are refused.
    """
    if not commands_allowed():
        raise SutMissing(
            "this worker starts no commands that come from elsewhere: let it with --commands"
        )
    # Nobody who tests another stack pays for what talks to this one.
    from daemon.stacks.ros2.settings import read_settings
    from daemon.stacks.ros2.stack import Ros2Stack

    return Ros2Stack(read_settings(parameters))
