"""What a robot's sensors and the ROS stack have to do with each other: warnings for one robot.

A configuration says which topics are listened to and at which heights; only with the robot is it
known which lasers there are. What is found is what would happen with the original, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from daemon.stacks.findings import ParameterFinding, ParameterLocation
from daemon.stacks.ros1.configuration import RosParameters
from daemon.stacks.ros1.costmap import point_height
from daemon.stacks.ros1.costmap.layers import (
    LayeredCostmap,
    ObservationSource,
    ObstacleLayer,
    VoxelLayer,
)
from daemon.stacks.ros1.costmap_sources import COSTMAPS
from grammars.model.robot import Laser, Robot

_SCAN: Final[ParameterLocation] = ("topics", "scan")


def advise_for_robot(parameters: RosParameters, robot: Robot) -> Iterator[ParameterFinding]:
    """Yield what does not fit between the lasers of ``robot`` and who listens to them."""
    names = [laser.name for laser in robot.lasers]
    yield from _unknown_lasers(parameters, names)
    yield from _unheard_lasers(parameters, robot)
    yield from _deaf_localisation(parameters, robot)
    for name in COSTMAPS:
        costmap: LayeredCostmap = getattr(parameters, name)
        for layer in costmap.layers:
            if isinstance(layer, ObstacleLayer):
                place = ("move_base", name, layer.name)
                for source in layer.sources:
                    yield from _about_source(parameters, robot, layer, source, place)


def _unknown_lasers(parameters: RosParameters, names: Sequence[str]) -> Iterator[ParameterFinding]:
    for name in parameters.topics.by_laser:
        if name not in names:
            there = ", ".join(other for other in names if other)
            message = f"the robot has no laser {name}"
            hint = f"its lasers are {there}" if there else "its only laser has no name"
            yield ParameterFinding((*_SCAN, name), message, hint)


def _unheard_lasers(parameters: RosParameters, robot: Robot) -> Iterator[ParameterFinding]:
    names = [laser.name for laser in robot.lasers]
    heard = parameters.topics.heard(names)
    listened = {*heard.amcl, *heard.global_costmap, *heard.local_costmap}
    for laser in robot.lasers:
        if laser.name in listened:
            continue
        topics = parameters.topics.topics_of(laser.name, names)
        where = f"it is published on {', '.join(topics)}" if topics else "it is published nowhere"
        message = f"nobody listens to the {laser.label} of robot {robot.name}: {where}"
        hint = "topics/scan says where lasers are published"
        yield ParameterFinding(_SCAN, message, hint)


def _deaf_localisation(parameters: RosParameters, robot: Robot) -> Iterator[ParameterFinding]:
    topics = parameters.topics
    names = [laser.name for laser in robot.lasers]
    # Of a robot with one laser the configuration itself tells.
    if topics.heard(names).amcl or (len(names) == 1 and not topics.by_laser):
        return
    published = [topic for name in names for topic in topics.topics_of(name, names)]
    message = (
        f"amcl listens to {topics.amcl}, the lasers of robot {robot.name} are on "
        f"{', '.join(published) or 'no topic'}"
    )
    yield ParameterFinding(_SCAN, message, "amcl never corrects odometry")


def _about_source(
    parameters: RosParameters,
    robot: Robot,
    layer: ObstacleLayer,
    source: ObservationSource,
    place: ParameterLocation,
) -> Iterator[ParameterFinding]:
    topics = parameters.topics
    names = [laser.name for laser in robot.lasers]
    title = str(place[1]).replace("_", " ")
    heard = topics.lasers_on(source.topic, names)
    if not heard and topics.may_carry_scan(source.topic):
        message = (
            f'the source "{source.name}" of the {title} listens to {source.topic}, where robot '
            f"{robot.name} publishes no laser"
        )
        hint = "topics/scan says where lasers are published"
        if source.expected_update_rate > 0.0:
            message += f": after {source.expected_update_rate:g} s move_base would stop the robot"
        yield ParameterFinding((*place, source.name, "topic"), message, hint)
    for laser in robot.lasers:
        if laser.name in heard:
            yield from _about_height(laser, layer, source, (*place, source.name), title)
            yield from _about_rate(laser, source, (*place, source.name))


def _about_height(
    laser: Laser,
    layer: ObstacleLayer,
    source: ObservationSource,
    place: ParameterLocation,
    title: str,
) -> Iterator[ParameterFinding]:
    """Yield the limit that leaves a laser out: of the source, of the layer, of its voxels."""
    at, height = f"the {laser.label} at {laser.z:g} m", point_height(laser.z)
    if height < source.min_obstacle_height:
        message = f"the {title} ignores {at}, below {source.min_obstacle_height:g} m"
        yield ParameterFinding((*place, "min_obstacle_height"), message)
    elif height > source.max_obstacle_height:
        message = f"the {title} ignores {at}, above {source.max_obstacle_height:g} m"
        yield ParameterFinding((*place, "max_obstacle_height"), message)
    elif not source.marking:
        return
    elif height > layer.max_obstacle_height:
        message = (
            f"{at} marks nothing in the layer {layer.name} of the {title}, whose limit is "
            f"{layer.max_obstacle_height:g} m"
        )
        yield ParameterFinding((*place[:-1], "max_obstacle_height"), message)
    elif isinstance(layer, VoxelLayer):
        top = layer.origin_z + layer.z_voxels * layer.z_resolution
        if height >= top:
            message = (
                f"{at} marks nothing in the layer {layer.name} of the {title}, whose voxels end "
                f"at {top:g} m"
            )
            yield ParameterFinding((*place[:-1], "z_voxels"), message)


def _about_rate(
    laser: Laser, source: ObservationSource, place: ParameterLocation
) -> Iterator[ParameterFinding]:
    expected = source.expected_update_rate
    if expected > 0.0 and laser.rate > 0.0 and 1.0 / laser.rate > expected:
        message = (
            f"a scan of the {laser.label} comes every {1.0 / laser.rate:g} s, and move_base would "
            f"stop the robot whenever none came for {expected:g} s; here it does not"
        )
        place = (*place, "expected_update_rate")
        yield ParameterFinding(place, message, "write a longer time, or 0 for none")
