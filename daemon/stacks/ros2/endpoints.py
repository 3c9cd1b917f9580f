"""Which topics, actions and nodes of a stack a run has to do with, by its settings."""

from __future__ import annotations

from daemon.stacks.ros2 import sensors, telemetry
from daemon.stacks.ros2.link import LinkSetup, TopicSetup
from daemon.stacks.ros2.settings import Ros2Settings


def link_setup(settings: Ros2Settings) -> LinkSetup:
    """Return everything a link makes for a stack with these settings."""
    topics = settings.topics
    publish = [
        TopicSetup(topics.odom, sensors.ODOMETRY, settings.qos.odom, 5),
        TopicSetup(topics.scan, sensors.SCAN, settings.qos.scan, 5),
        TopicSetup(topics.initial_pose, sensors.INITIAL_POSE),
    ]
    if settings.transforms != "none":
        publish.insert(0, TopicSetup(topics.tf, sensors.TRANSFORMS, depth=100))
    if settings.transforms == "all":
        publish.append(TopicSetup(topics.tf_static, sensors.TRANSFORMS, "latched", 1))
    if settings.map == "published":
        publish.append(TopicSetup(topics.map, sensors.GRID, "latched", 1))
    subscribe = (
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
