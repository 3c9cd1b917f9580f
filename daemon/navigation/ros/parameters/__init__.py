"""Reading ROS parameters: sections into models, names of topics, what is said about either.

:mod:`daemon.navigation.ros.configuration` puts the whole stack together from them.
"""

from __future__ import annotations

from daemon.navigation.ros.parameters._findings import (
    Finding,
    Findings,
    ParameterError,
    Path,
    Report,
    joined,
)
from daemon.navigation.ros.parameters._quirks import read_quirks
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
    "read_quirks",
    "read_section",
    "resolve_name",
    "resolve_topics",
]
