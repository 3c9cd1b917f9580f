"""Warnings about the attached parameter files of a stack that contradict its SUT file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, Final

from daemon.model.attachments import FILES_PARAMETER
from daemon.stacks.findings import ParameterFinding
from daemon.stacks.ros2.settings import Ros2Settings
from grammars.text.diagnostics import InputError
from grammars.text.ros_yaml import load_ros_yaml

_BASE_FRAMES: Final = ("robot_base_frame", "base_frame_id")
_ROUNDING: Final = 1e-6
_WALL_CLOCK: Final = re.compile(r"use_sim_time:=false", re.IGNORECASE)


def contradictions(settings: Ros2Settings) -> Iterator[ParameterFinding]:
    """Yield the values of launch command and attached files that do not fit the SUT file."""
    if _WALL_CLOCK.search(settings.launch):
        message = "use_sim_time:=false lets the stack run by another clock than the simulation"
        yield ParameterFinding(("launch",), message, "write use_sim_time:=true")
    for name, path in settings.files.items():
        try:
            document, _ = load_ros_yaml(path)
        except InputError:
            continue  # not a parameter file: the stack knows how to read it
        values: dict[tuple[str, Any], list[str]] = {}
        for node, key, value in _parameters(document.data, ""):
            values.setdefault((key, value), []).append(node)
        for (key, value), nodes in values.items():
            problem = _problem(settings, key, value)
            if problem:
                more = f" and {len(nodes) - 1} more" if len(nodes) > 1 else ""
                message = f"{key} of {nodes[0]}{more} is {value}, {problem[0]}"
                yield ParameterFinding((FILES_PARAMETER, name), message, problem[1])


def _problem(settings: Ros2Settings, key: str, value: Any) -> tuple[str, str] | None:
    """Return why a parameter does not fit, and a remedy."""
    base, period = settings.frames.base, settings.period
    if key == "use_sim_time" and value is False:
        return "another clock than that of the simulation", "write true"
    if key in _BASE_FRAMES and value != base:
        return (
            f"the simulation publishes {base}",
            f"write frames: {{base: {value}}} in the SUT file",
        )
    # Faster controllers are the way to run a stack faster than real time.
    if key == "controller_frequency" and 0.0 < float(value) * period < 1.0 - _ROUNDING:
        return f"period is {period:g} s", f"write period: {1.0 / float(value):g} s"
    return None


def _parameters(tree: Any, node: str) -> Iterator[tuple[str, str, Any]]:
    """Yield node, key and value of each parameter below ``ros__parameters``."""
    for key, value in tree.items() if isinstance(tree, dict) else ():
        if key == "ros__parameters" and isinstance(value, dict):
            plain = (v for v in value.items() if isinstance(v[1], str | int | float))
            yield from ((node, name, one) for name, one in plain)
        else:
            yield from _parameters(value, f"{node}/{key}".lstrip("/"))
