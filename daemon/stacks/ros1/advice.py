"""Advice about a configuration for a robot and its mission.

A configuration gives the topics of listeners and their heights, a robot the body and the lasers.
Advice also describes what the original would do.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from daemon.stacks.findings import ParameterFinding, ParameterLocation
from daemon.stacks.ros1.configuration import RosParameters, namespace_of
from daemon.stacks.ros1.costmap import point_height
from daemon.stacks.ros1.costmap.layers import (
    LayeredCostmap,
    ObservationSource,
    ObstacleLayer,
    VoxelLayer,
)
from daemon.stacks.ros1.wiring import COSTMAPS, Topics, blind
from grammars.model.mission import Mission
from grammars.model.robot import Drive, Laser, Robot
from grammars.text.words import first_words

_SCAN: Final[ParameterLocation] = ("topics", "scan")
_WHERE: Final = "topics/scan says where lasers are published"
_LARGEST_OUT: Final = 0.1
"""Share of a robot's radius that may stick out of a footprint, which is often simplified."""
_FASTEST: Final = 4.0
"""Speed ahead of a planner in top speeds of the robot: more may be centimetres a second."""
_LARGEST: Final = 1.9
"""Size of a footprint in sizes of the robot: more may be diameters for radii, or centimetres."""
_ARRIVAL: Final = 0.5
"""Largest tolerance of arrival at a waypoint [m]; the tolerances of stacks are smaller."""


def advise(settings: RosParameters, robot: Robot, mission: Mission) -> Iterator[ParameterFinding]:
    """Yield warnings about ``settings`` that do not fit ``robot`` or its ``mission``."""
    costmaps = settings.global_costmap, settings.local_costmap
    yield from _about_lasers(settings.topics, costmaps, robot)
    yield from _about_body(costmaps, robot)
    yield from _about_drive(settings, robot.drive)
    yield from _about_mission(settings.global_costmap, mission)


def _about_lasers(
    topics: Topics, costmaps: tuple[LayeredCostmap, LayeredCostmap], robot: Robot
) -> Iterator[ParameterFinding]:
    """Yield warnings about lasers that do not fit their listeners."""
    names = [laser.name for laser in robot.lasers]
    for name in topics.by_laser:
        if name not in names:
            others = ", ".join(other for other in names if other)
            hint = f"its lasers are {others}" if others else "its only laser has no name"
            yield ParameterFinding((*_SCAN, name), f"the robot has no laser {name}", hint)
    wiring = topics.wire(names)
    used = {*wiring.amcl, *wiring.global_costmap, *wiring.local_costmap}
    for laser in robot.lasers:
        if laser.name not in used:
            published = ", ".join(topics.topics_of(laser.name, names))
            where = f"it is published on {published}" if published else "it is published nowhere"
            message = f"nobody listens to the {laser.label} of robot {robot.name}: {where}"
            yield ParameterFinding(_SCAN, message, _WHERE)
    if not wiring.amcl:
        published = ", ".join(topic for name in names for topic in topics.topics_of(name, names))
        message = (
            f"amcl listens to {topics.amcl}, the lasers of robot {robot.name} are on "
            f"{published or 'no topic'}"
        )
        hint = "amcl never corrects odometry: set topics/amcl or topics/remap"
        yield ParameterFinding(_SCAN, message, hint)
    for name, costmap in zip(COSTMAPS, costmaps, strict=True):
        yield from _about_costmap(name, costmap, topics, robot)


def _about_body(
    costmaps: tuple[LayeredCostmap, LayeredCostmap], robot: Robot
) -> Iterator[ParameterFinding]:
    """Yield warnings about footprints that are certainly not those of ``robot``."""
    # Only advice about robots needs shapely.
    from shapely import MultiPoint, Point

    body = np.array(robot.footprint)
    own_length, own_width = np.ptp(body, axis=0)
    padded = [costmap.padded_footprint() for costmap in costmaps]
    titles = [f"the {name.replace('_', ' ')}" for name in COSTMAPS]
    if np.array_equal(padded[0], padded[1]):
        titles = ["both costmaps"]
    for name, title, costmap, corners in zip(COSTMAPS, titles, costmaps, padded, strict=False):
        hull = MultiPoint(corners).convex_hull
        out = max(hull.distance(Point(corner)) for corner in body)
        length, width = np.ptp(corners, axis=0) - 2.0 * costmap.footprint_padding
        if out > _LARGEST_OUT * np.hypot(*body.T).max():
            effect = f"it sticks out by {out:.2f} m, which nothing keeps off obstacles"
        elif length > _LARGEST * own_length and width > _LARGEST * own_width:
            effect = "it keeps out of passages through which it fits"
        else:
            continue
        message = (
            f"the footprint of {title} is {length:.2f} m x {width:.2f} m, robot {robot.name} "
            f"is {own_length:.2f} m x {own_width:.2f} m: {effect}"
        )
        path = ("move_base", name, "footprint" if costmap.footprint else "robot_radius")
        yield ParameterFinding(path, message, "write the robot's own, in metres")


def _about_drive(settings: RosParameters, drive: Drive) -> Iterator[ParameterFinding]:
    """Yield warnings about motions that no ``drive`` of this kind makes."""
    model, speed = settings.amcl.odom_model_type, settings.local_planner.max_vel_x
    if drive.kind == "differential" and model.startswith("omni"):
        message = f"{model} expects sideways motion, the robot has a differential drive"
        hint = f"write {model.replace('omni', 'diff')}"
        yield ParameterFinding(("amcl", "odom_model_type"), message, hint)
    if speed > _FASTEST * drive.max_vx:
        planner = namespace_of(settings.move_base.base_local_planner)
        message = f"it is {speed:g} m/s, the robot drives {drive.max_vx:g} m/s at most"
        path = ("move_base", planner, "max_vel_x")
        yield ParameterFinding(path, message, "write metres a second")


def _about_mission(costmap: LayeredCostmap, mission: Mission) -> Iterator[ParameterFinding]:
    """Yield a warning about waypoints outside of a rolling global ``costmap``.

    Planners refuse a goal outside of the window around the robot at the beginning of its leg.
    """
    half = np.array((costmap.width / 2.0, costmap.height / 2.0))
    at, outside = np.array((mission.start.x, mission.start.y)), []
    for waypoint in mission.waypoints if costmap.rolling_window else ():
        goal = np.array((waypoint.x, waypoint.y))
        away = np.abs(goal - at) - half
        if costmap.frame == "odom":
            # Its axes may be turned against those of the map.
            away = np.hypot(*(goal - at)) - np.hypot(*half)
        if np.max(away) > _ARRIVAL:
            outside.append(waypoint.id)
        else:
            at = goal
    if outside:
        message = (
            f"{first_words(outside)} of mission {mission.name}: outside of the rolling "
            f"window of the global costmap, {costmap.width:g} m x {costmap.height:g} m, when the "
            "leg begins: planners refuse such goals"
        )
        path = ("move_base", "global_costmap", "rolling_window")
        yield ParameterFinding(path, message, "use a larger window, or rolling_window: false")


def _about_costmap(
    name: str, costmap: LayeredCostmap, topics: Topics, robot: Robot
) -> Iterator[ParameterFinding]:
    title, names = name.replace("_", " "), [laser.name for laser in robot.lasers]
    sources = list(costmap.laser_sources())
    sees = any(topics.lasers_on(source.topic, names) for _, source in sources)
    for layer, source in sources:
        below = ("move_base", name, layer.name, source.name)
        audible = topics.lasers_on(source.topic, names)
        if not audible:
            message = (
                f'the source "{source.name}" of the {title} listens to {source.topic}, where robot '
                f"{robot.name} publishes no laser"
            )
            hint = _WHERE if sees else blind(title)
            rate = source.expected_update_rate
            if rate > 0.0:
                message += f": after {rate:g} s move_base would stop the robot"
            yield ParameterFinding((*below, "topic"), message, hint)
        for laser in robot.lasers:
            if laser.name in audible:
                yield from _about_laser(laser, layer, source, below)


def _about_laser(
    laser: Laser, layer: ObstacleLayer, source: ObservationSource, place: ParameterLocation
) -> Iterator[ParameterFinding]:
    """Yield warnings about a height that excludes a laser, and a rate that would stop the robot."""
    _, name, *_ = place
    title, above = str(name).replace("_", " "), place[:-1]
    at, height = f"the {laser.label} at {laser.z:g} m", point_height(laser.z)
    marks_nothing = f"{at} marks nothing in the layer {layer.name} of the {title}"
    if height < source.min_obstacle_height:
        message = f"the {title} ignores {at}, below {source.min_obstacle_height:g} m"
        yield ParameterFinding((*place, "min_obstacle_height"), message)
    elif height > source.max_obstacle_height:
        message = f"the {title} ignores {at}, above {source.max_obstacle_height:g} m"
        yield ParameterFinding((*place, "max_obstacle_height"), message)
    elif source.marking and height > layer.max_obstacle_height:
        message = f"{marks_nothing}, whose limit is {layer.max_obstacle_height:g} m"
        yield ParameterFinding((*above, "max_obstacle_height"), message)
    elif source.marking and isinstance(layer, VoxelLayer) and height >= layer.top:
        message = f"{marks_nothing}, whose voxels end at {layer.top:g} m"
        yield ParameterFinding((*above, "z_voxels"), message)
    expected = source.expected_update_rate
    if expected > 0.0 and laser.rate > 0.0 and 1.0 / laser.rate > expected:
        message = (
            f"a scan of the {laser.label} comes every {1.0 / laser.rate:g} s, and move_base would "
            f"stop the robot after {expected:g} s without one; here it does not"
        )
        place = (*place, "expected_update_rate")
        yield ParameterFinding(place, message, "write a longer time, or 0 for none")
