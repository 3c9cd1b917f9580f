"""The protocol of systems under test, under the name that plug-ins use.

A package of yours names a factory under the entry point group ``scenario.suts``; what it makes is
a :class:`SystemUnderTest`. See :mod:`daemon.model.sut` for the contract. It has to be made within
10 s of wall clock; what takes longer belongs into ``start``. All chance comes from the briefing's
``seed``: ``scenario verify`` tells what does not.
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
