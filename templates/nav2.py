"""Nav2 for a robot: SUT file, launch file and parameters.

Parameters are those of ROS 2 Jazzy and Kilted, with names and types from the configuration guide of
Nav2. Frames follow REP 105.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from grammars.model.geometry import Ring
from grammars.model.robot import Laser, Robot
from templates.rendering import render

NAV2: Final = "my-nav2"
"""Name of the system under test."""
NAV2_FILE: Final = f"suts/{NAV2}.yaml"

_LOCALIZATION: Final = {"map_server": "nav2_map_server", "amcl": "nav2_amcl"}
_NAVIGATION: Final = {
    "controller_server": "nav2_controller",
    "planner_server": "nav2_planner",
    "behavior_server": "nav2_behaviors",
    "bt_navigator": "nav2_bt_navigator",
}
"""Packages by node, in the order in which the lifecycle managers activate them."""
_MANAGERS: Final = {
    "lifecycle_manager_localization": tuple(_LOCALIZATION),
    "lifecycle_manager_navigation": tuple(_NAVIGATION),
}
_FREQUENCIES: Final = (20.0, 25.0, 10.0, 50.0)
"""Frequencies of the controller [Hz], the usual one first; periods are multiples of 0.01 s."""
_UNLIMITED: Final = {"vx": 0.5, "vy": 0.5, "wz": 1.0, "ax": 1.0, "ay": 1.0, "az": 2.0}
"""Default limits [m/s, rad/s, m/s^2, rad/s^2] if the robot file sets none."""
_TOLERANCE: Final = 0.15
"""Tolerance of a goal [m], half of that in the oracles of a new campaign."""
_HORIZON: Final = 1.5
"""Time that DWB looks ahead [s]."""
_LEAST_SIDE: Final = 4
"""Least side of the local costmap [m]."""
_FAR: Final = 6.0
"""Distance beyond which obstacles do not affect the next motion [m]."""
_INFLATION: Final = 0.2
"""Inflation beyond the outermost corner of the robot [m]."""
_MOST_BEAMS: Final = 60
_MOST_CORNERS: Final = 16
"""A regular outline with more corners represents a circle."""


def nav2_files(robot: Robot) -> Mapping[str, str]:
    """Return the files of a Nav2 system for ``robot`` by their paths, :data:`NAV2_FILE` first."""
    frequency = _frequency(robot)
    nodes = _LOCALIZATION | _NAVIGATION
    sut = {"robot": robot.name, "ready": tuple(nodes), "period": 1.0 / frequency}
    # The template contains the map server, which also needs the map.
    others = [(package, node) for node, package in nodes.items() if node != "map_server"]
    return {
        NAV2_FILE: render("nav2/my-nav2.yaml.j2", **sut),
        "suts/nav2.launch.xml": render("nav2/nav2.launch.xml.j2", nodes=others, managers=_MANAGERS),
        "suts/nav2.yaml": render("nav2/nav2.yaml.j2", **_parameters(robot, frequency)),
    }


def _frequency(robot: Robot) -> float:
    """Return a frequency of the controller [Hz] that has whole ratios to the sensors' rates."""
    rates = [laser.rate for laser in robot.lasers] + [robot.odometry.rate]
    ratios = {f: [max(rate / f, f / rate) for rate in rates if rate > 0.0] for f in _FREQUENCIES}
    fitting = (f for f in _FREQUENCIES if all(map(_is_whole, ratios[f])))
    return next(fitting, _FREQUENCIES[0])


def _is_whole(ratio: float) -> bool:
    return math.isclose(ratio, round(ratio))


def _parameters(robot: Robot, frequency: float) -> Mapping[str, object]:
    """Return the values for the template of the parameters; lengths in m, angles in rad."""
    radii = [math.hypot(x, y) for x, y in robot.footprint]
    is_round = len(radii) > _MOST_CORNERS and math.isclose(min(radii), max(radii))
    drive = robot.drive
    limits = {name: getattr(drive, f"max_{name}") for name in _UNLIMITED}
    omni = drive.kind == "omnidirectional"
    if not omni:
        limits |= {"vy": 0.0, "ay": 0.0}
    values = {
        name: _real(limit if math.isfinite(limit) else _UNLIMITED[name])
        for name, limit in limits.items()
    }
    reach = _HORIZON * max(values["vx"], values["vy"]) + max(radii) + _INFLATION
    return {
        "robot": robot.name,
        "omni": omni,
        "radius": _real(max(radii)) if is_round else None,
        "footprint": _outline(robot.footprint),
        "inflation": _real(max(radii) + _INFLATION),
        "lasers": list(map(_laser, robot.lasers)),
        "beams": min(_MOST_BEAMS, robot.laser.rays),
        "frequency": frequency,
        "costmap": _real(min(10.0, robot.laser.rate)),
        "tolerance": _TOLERANCE,
        "unlimited": not all(map(math.isfinite, limits.values())),
        "horizon": _HORIZON,
        "side": max(_LEAST_SIDE, math.ceil(2.0 * reach)),
        "managers": _MANAGERS,
        **values,
    }


def _laser(laser: Laser) -> Mapping[str, object]:
    clears = min(laser.range_max, _FAR)
    return {
        "topic": laser.topic,
        "range_min": _real(laser.range_min),
        "range_max": _real(laser.range_max),
        "clears": _real(clears),
        "obstacles": _real(0.9 * clears),
    }


def _outline(ring: Ring) -> str:
    return f"[{', '.join(f'[{_real(x)}, {_real(y)}]' for x, y in ring)}]"


def _real(value: float) -> float:
    """Return a number that ROS reads as a double: with a decimal point, never ``-0.0``."""
    return round(float(value), 4) + 0.0
