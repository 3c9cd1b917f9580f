"""Nav2 for a robot: the SUT file that starts it, its launch file and its parameters.

The parameters are those of ROS 2 Jazzy and Kilted, frames those of REP 105. Sources of names and
types: the configuration guide of Nav2.
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
"""[Hz] Of the controller, the usual one first; periods are multiples of 0.01 s."""
_UNLIMITED: Final = {"vx": 0.5, "vy": 0.5, "wz": 1.0, "ax": 1.0, "ay": 1.0, "az": 2.0}
"""[m/s, rad/s, m/s^2, rad/s^2] Where the robot file sets no limit."""
_TOLERANCE: Final = 0.15
"""[m] Of a goal, half of what the oracles of a new campaign allow."""
_HORIZON: Final = 1.5
"""[s] For which DWB looks ahead."""
_LEAST_SIDE: Final = 4
"""[m] Of the local costmap."""
_FAR: Final = 6.0
"""[m] Obstacles farther off do not change what is driven next."""
_INFLATION: Final = 0.2
"""[m] Beyond the outermost corner of the robot."""
_MOST_BEAMS: Final = 60
_MOST_CORNERS: Final = 16
"""A regular outline with more corners stands for a circle."""


def nav2_files(robot: Robot) -> Mapping[str, str]:
    """Return the files of a Nav2 system for ``robot`` by their paths, :data:`NAV2_FILE` first."""
    frequency = _frequency(robot)
    nodes = _LOCALIZATION | _NAVIGATION
    sut = {"robot": robot.name, "ready": tuple(nodes), "period": 1.0 / frequency}
    # The map server is written out: it has the map as well.
    others = [(package, node) for node, package in nodes.items() if node != "map_server"]
    return {
        NAV2_FILE: render("nav2/my-nav2.yaml.j2", **sut),
        "suts/nav2.launch.xml": render("nav2/nav2.launch.xml.j2", nodes=others, managers=_MANAGERS),
        "suts/nav2.yaml": render("nav2/nav2.yaml.j2", **_parameters(robot, frequency)),
    }


def _frequency(robot: Robot) -> float:
    """Return a frequency of the controller [Hz] of which the sensors' rates are whole parts."""
    rates = [laser.rate for laser in robot.lasers] + [robot.odometry.rate]
    ratios = {f: [max(rate / f, f / rate) for rate in rates if rate > 0.0] for f in _FREQUENCIES}
    fitting = (f for f in _FREQUENCIES if all(map(_is_whole, ratios[f])))
    return next(fitting, _FREQUENCIES[0])


def _is_whole(ratio: float) -> bool:
    return math.isclose(ratio, round(ratio))


def _parameters(robot: Robot, frequency: float) -> Mapping[str, object]:
    """Return what the template of the parameters is filled with; lengths in m, angles in rad."""
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
    """Return a number as ROS takes it for a double: written with a point, never as ``-0.0``."""
    return round(float(value), 4) + 0.0
