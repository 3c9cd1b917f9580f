"""Launch files of ROS 1 (roslaunch XML): what each node they start would find when it starts.

No ROS is needed and nothing is run. :func:`load_launch` gives the nodes, their parameters with
the places they were written at, and the names that remaps give them.
"""

from grammars.roslaunch._load import load_launch
from grammars.roslaunch._model import (
    Launch,
    LaunchNode,
    LaunchRemap,
    LaunchSettings,
    NodeType,
)
from grammars.roslaunch._names import resolve_for_node
from grammars.roslaunch._search import launch_files_starting

__all__ = [
    "Launch",
    "LaunchNode",
    "LaunchRemap",
    "LaunchSettings",
    "NodeType",
    "launch_files_starting",
    "load_launch",
    "resolve_for_node",
]
