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

__all__ = [
    "Launch",
    "LaunchNode",
    "LaunchRemap",
    "LaunchSettings",
    "NodeType",
    "load_launch",
    "resolve_for_node",
]
