"""The protocol of systems under test, for plug-ins.

Your package names a factory under the entry point group ``scenario.suts``. The factory returns a
:class:`SystemUnderTest` within 10 s of wall clock; longer work belongs into ``start``. All random
numbers come from the briefing's ``seed``: ``scenario verify`` reports others. The contract is in
:mod:`daemon.model.sut`.
"""

from daemon.model.sut import (
    Briefing,
    Cloud,
    CostmapPicture,
    Decision,
    Estimate,
    ExternalSystem,
    LaserScan,
    Observation,
    Odometry,
    Progress,
    SutEvent,
    SutFailure,
    SystemUnderTest,
)
from grammars.model.geometry import Pose2, Twist2

__all__ = [
    "Briefing",
    "Cloud",
    "CostmapPicture",
    "Decision",
    "Estimate",
    "ExternalSystem",
    "LaserScan",
    "Observation",
    "Odometry",
    "Pose2",
    "Progress",
    "SutEvent",
    "SutFailure",
    "SystemUnderTest",
    "Twist2",
]
