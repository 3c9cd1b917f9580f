"""Topics, actions and nodes of a run by the settings of its stack, and its messages.

A live world, which runs by the clock, uses the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from daemon.model.sut import Briefing, LaserScan, Odometry
from daemon.stacks.ros2 import sensors, telemetry
from daemon.stacks.ros2.link import LinkSetup, TopicSetup
from daemon.stacks.ros2.settings import Ros2Settings
from grammars.model.robot import Laser


def link_setup(settings: Ros2Settings, lasers: Sequence[Laser]) -> LinkSetup:
    """Return the setup of a link for a stack with these settings and a robot's ``lasers``."""
    topics = settings.topics
    publish = [
        TopicSetup(topics.odom, sensors.ODOMETRY, settings.qos.odom, 5),
        *(
            TopicSetup(name, sensors.SCAN, settings.qos.scan, 5)
            for name in scan_topics(settings, lasers)
        ),
        TopicSetup(topics.initial_pose, sensors.INITIAL_POSE),
    ]
    if settings.transforms != "none":
        publish.insert(0, TopicSetup(topics.tf, sensors.TRANSFORMS, depth=100))
    if settings.transforms == "all":
        publish.append(TopicSetup(topics.tf_static, sensors.TRANSFORMS, "latched", 1))
    if settings.map == "published":
        publish.append(TopicSetup(topics.map, sensors.GRID, "latched", 1))
    subscribe = (
        *telemetry.report_subscriptions(settings),
        TopicSetup(topics.tf, sensors.TRANSFORMS, depth=100, keep="all"),
        TopicSetup(topics.tf_static, sensors.TRANSFORMS, "latched", 100, keep="all"),
        TopicSetup(topics.pose, telemetry.POSE),
        TopicSetup(topics.particles, telemetry.PARTICLES, "best effort"),
        TopicSetup(topics.plan, telemetry.PATH),
        TopicSetup(topics.local_plan, telemetry.PATH),
        TopicSetup(telemetry.ROSOUT, telemetry.LOG, depth=1000, keep="all"),
    )
    return LinkSetup(
        tuple(publish),
        subscribe,
        topics.command,
        settings.action,
        settings.action_kind,
        settings.ready,
    )


def scan_topics(settings: Ros2Settings, lasers: Sequence[Laser]) -> tuple[str, ...]:
    """Return the topics of scans; several lasers may share one."""
    return tuple(dict.fromkeys(settings.scan_topic(laser) for laser in lasers))


def fixed_messages(
    settings: Ros2Settings, briefing: Briefing, time: int
) -> Iterator[tuple[str, bytes]]:
    """Yield topic and CDR of messages that are published once, at ROS ``time`` [ns].

    They are the transforms of the lasers on the robot, and the map if it is a topic.
    """
    if settings.transforms == "all":
        mounted = sensors.laser_transforms(briefing.robot.lasers, time, settings.frames)
        yield settings.topics.tf_static, mounted
    if settings.map == "published":
        yield settings.topics.map, sensors.occupancy_grid(briefing.map, time, settings.frames)


def measured_messages(
    settings: Ros2Settings,
    lasers: Sequence[Laser],
    odometry: Sequence[Odometry],
    scans: Sequence[LaserScan],
    stamp: Callable[[float], int],
) -> Iterator[tuple[str, bytes]]:
    """Yield topic and CDR of measurements: for each sample its transform first, scans last.

    ``stamp`` turns simulated time [s] into ROS time [ns].
    """
    topics, frames = settings.topics, settings.frames
    for sample in odometry:
        time = stamp(sample.time)
        if settings.transforms != "none":
            yield topics.tf, sensors.odometry_transform(sample, time, frames)
        yield topics.odom, sensors.odometry(sample, time, frames)
    named = {laser.name: laser for laser in lasers}
    for sweep in scans:
        laser = named[sweep.laser]
        yield settings.scan_topic(laser), sensors.scan(sweep, laser, stamp(sweep.time), frames)
