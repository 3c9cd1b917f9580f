"""Parameter files that are not for this stack: of Nav2, or without a word that anybody reads.

ROS would ignore them without a word and run on defaults nobody asked for.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from daemon.campaign._parameters import ParameterPath, ParameterValues
from daemon.stacks.findings import ParameterFindings
from grammars.text.diagnostics import Diagnostic, InputError
from grammars.text.documents import KeyPath, YamlDocument
from grammars.text.sources import note_read

_ROS2_MARK: Final = "ros__parameters"
_DEEPEST: Final = 5
_SECTIONS: Final = ("amcl", "move_base")
_COUNTERPARTS: Final = {
    "amcl": "amcl (here odom_alpha1 for alpha1, odom_model_type for robot_model_type, "
    "laser_max_beams, laser_z_hit, laser_sigma_hit for max_beams, z_hit, sigma_hit, "
    "kld_err for pf_err)",
    "controller_server": "a DWB controller as move_base/DWAPlannerROS (max_vel_trans for "
    "max_speed_xy), controller_frequency as move_base/controller_frequency",
    "planner_server": "a NavfnPlanner as move_base/NavfnROS (default_tolerance for tolerance)",
    "global_costmap": "global_costmap as move_base/global_costmap",
    "local_costmap": "local_costmap as move_base/local_costmap",
    "behavior_server": "behaviors as move_base/recovery_behaviors",
    "recoveries_server": "recoveries as move_base/recovery_behaviors",
}
"""What the reference stack has of each node of Nav2, and under which names of ROS 1."""


def refuse_nav2(document: YamlDocument) -> None:
    """Raise :class:`InputError` for a parameter file of ROS 2, with what can be done."""
    found = list(_ros2_sections(document.data, ()))
    if not found:
        return
    names = list(dict.fromkeys(str(path[-1]) if path else "" for path in found))
    known = [_COUNTERPARTS[name] for name in names if name in _COUNTERPARTS]
    other = [name for name in names if name and name not in _COUNTERPARTS]
    hints = ['Nav2 itself is tested as an external system: "kind: ros2" (docs/ros2.md)']
    if known:
        hints.append(f"the reference stack has, under names of ROS 1: {'; '.join(known)}")
    if other:
        hints.append(f"nothing here corresponds to {', '.join(other)}")
    message = f"is a parameter file of ROS 2 ({_ROS2_MARK}), of which move_base reads nothing"
    raise InputError.at(document.where((*found[0], _ROS2_MARK)), message, "\n    ".join(hints))


def _ros2_sections(data: Any, path: KeyPath) -> Iterator[KeyPath]:
    if not isinstance(data, Mapping) or len(path) > _DEEPEST:
        return
    for name, below in data.items():
        if name == _ROS2_MARK:
            yield path
        else:
            yield from _ros2_sections(below, (*path, name))


def is_of_ros2(path: Path) -> bool:
    """Whether a file looks like one with parameters of ROS 2."""
    note_read(path)
    with path.open("rb") as file:
        return _ROS2_MARK.encode() in file.read(2**20)


def refuse_unread(
    settings: ParameterValues, findings: ParameterFindings, files: Iterable[str]
) -> None:
    """Raise :class:`InputError` for each of ``files`` of which nobody reads anything."""
    unread = {finding.path for finding in findings.problems if finding.unread}
    problems = []
    for file in files:
        own = {path: s for path, s in settings.items() if s.where.file == file}
        if own and all(any(path[:n] in unread for n in range(1, len(path) + 1)) for path in own):
            first, setting = next(iter(own.items()))
            message = f"nobody reads anything in this file: {'/'.join(first)} is no parameter here"
            problems.append(Diagnostic(setting.where, message, _remedy(own)))
    if problems:
        raise InputError(problems)


def _remedy(paths: Iterable[ParameterPath]) -> str:
    """Say what a file should look like that has a node's parameters below another name."""
    for path in paths:
        for node in _SECTIONS:
            if node in path[1:-1]:
                index = max(i for i, part in enumerate(path[:-1]) if part == node)
                extra, meant = "/".join(path[:index]), "/".join(path[index:])
                return (
                    f"{meant} is meant: take {extra} away, in the file or in the namespace it is "
                    'loaded into ("/" is none)'
                )
    return "load it into the namespace of the node that reads it, see files"
