"""ROS parameters as people have them, read into the models of the components."""

from __future__ import annotations

from daemon.navigation.ros.parameters._findings import (
    Finding,
    Findings,
    ParameterError,
    Path,
    Report,
    joined,
)
from daemon.navigation.ros.parameters._reading import read_section
from daemon.navigation.ros.parameters._topics import (
    TopicParameters,
    Topics,
    Wiring,
    resolve_name,
    resolve_topics,
)

__all__ = [
    "Finding",
    "Findings",
    "ParameterError",
    "Path",
    "Report",
    "TopicParameters",
    "Topics",
    "Wiring",
    "joined",
    "read_section",
    "resolve_name",
    "resolve_topics",
]
