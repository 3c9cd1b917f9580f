"""The settings of a stack that nobody wrote, as they would be written."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Final

from daemon.stacks.ros2.settings import Ros2Settings, read_settings

_SECONDS: Final = ("start_up", "patience", "tolerance", "idle", "period")
_PLAIN: Final = (
    "python",
    "namespace",
    "map",
    "transforms",
    "initial_pose",
    "mission",
    "action",
    "ready",
)
_SECTIONS: Final = ("topics", "qos", "frames")


def settings_not_written(parameters: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the values that apply where a tree of parameters has none, by section.

    The section of keys at the top of a file is called ``stack``. Names of topics and of the action
    are absolute. Raises :class:`~daemon.stacks.findings.ParameterError`.
    """
    settings = read_settings(parameters)
    sections = {
        "stack": (parameters, _at_the_top(settings)),
        "environment": (
            parameters.get("environment"),
            {"ROS_DOMAIN_ID": "own" if settings.domain is None else settings.domain},
        ),
        **{name: (parameters.get(name), _names(getattr(settings, name))) for name in _SECTIONS},
    }
    if settings.container is not None:
        engine, network = settings.container.engine, settings.container.network
        written = parameters.get("container")
        sections["container"] = (written, {"engine": engine, "network": network})
    return {name: _left_out(given or {}, values) for name, (given, values) in sections.items()}


def _names(section: Any) -> dict[str, Any]:
    """Return the names in a section; those by laser are written or not there."""
    values = dataclasses.asdict(section)
    return {name: value for name, value in values.items() if isinstance(value, str)}


def _at_the_top(settings: Ros2Settings) -> dict[str, Any]:
    seconds = {name: f"{getattr(settings, name):g} s" for name in _SECONDS}
    plain = {name: getattr(settings, name) or "none" for name in _PLAIN}
    plain["ready"] = list(settings.ready) or "none"
    late = f"{100.0 * settings.late:g} %"
    return {**plain, **seconds, "late": late}


def _left_out(given: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    spelled = {name.replace("_", "-"): value for name, value in values.items()}
    # The only key that is written with underscores.
    if "ROS_DOMAIN_ID" in values:
        spelled = dict(values)
    return {name: value for name, value in spelled.items() if given.get(name) is None}
