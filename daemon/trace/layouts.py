"""The layouts of the frequent topics: one prototype message each."""

from __future__ import annotations

import functools
from typing import Any, Final

import numpy as np

from daemon.trace import messages as ros
from daemon.trace.layout import Layout, Mark, derive
from grammars.robot import Laser

COVARIANCE_SLOTS: Final = (0, 1, 5, 6, 7, 11, 30, 31, 35)
"""Where x, y, yaw of a (3, 3) covariance lie in a row-major (6, 6) one over x..yaw."""

_NO_COVARIANCE: Final = np.zeros(36)


@functools.cache
def clock() -> Layout:
    """``/clock``: only the time."""
    kind = "rosgraph_msgs/msg/Clock"
    return derive("/clock", kind, lambda mark: ros.make(kind, clock=mark.stamp()))


@functools.cache
def odometry(topic: str, frame: str) -> Layout:
    """``/odom`` and ``/ground_truth``: x, y, qz, qw in ``frame``, vx, vy, wz in base_link."""
    kind = "nav_msgs/msg/Odometry"

    def build(mark: Mark) -> Any:
        return ros.make(
            kind,
            header=ros.header(mark.stamp(), frame),
            child_frame_id="base_link",
            pose=ros.make(
                "geometry_msgs/msg/PoseWithCovariance",
                pose=ros.pose(mark.f8("x"), mark.f8("y"), mark.f8("qz"), mark.f8("qw")),
                covariance=_NO_COVARIANCE,
            ),
            twist=ros.make(
                "geometry_msgs/msg/TwistWithCovariance",
                twist=ros.twist(mark.f8("vx"), mark.f8("vy"), mark.f8("wz")),
                covariance=_NO_COVARIANCE,
            ),
        )

    return derive(topic, kind, build)


@functools.lru_cache(maxsize=64)
def transforms(frames: tuple[tuple[str, str], ...]) -> Layout:
    """``/tf`` with one transform per (parent, child): x0, y0, qz0, qw0, x1, ..."""
    kind = "tf2_msgs/msg/TFMessage"

    def build(mark: Mark) -> Any:
        return ros.make(
            kind,
            transforms=[
                ros.transform(
                    mark.stamp(f"stamp{i}"),
                    parent,
                    child,
                    x=mark.f8(f"x{i}"),
                    y=mark.f8(f"y{i}"),
                    qz=mark.f8(f"qz{i}"),
                    qw=mark.f8(f"qw{i}"),
                )
                for i, (parent, child) in enumerate(frames)
            ],
        )

    return derive("/tf", kind, build)


@functools.lru_cache(maxsize=16)
def scan(laser: Laser) -> Layout:
    """``/scan``: ranges (rays,) float32."""
    kind = "sensor_msgs/msg/LaserScan"
    steps = max(laser.rays - 1, 1)

    def build(mark: Mark) -> Any:
        return ros.make(
            kind,
            header=ros.header(mark.stamp(), "laser"),
            angle_min=laser.angle_min,
            angle_max=laser.angle_max,
            angle_increment=(laser.angle_max - laser.angle_min) / steps,
            time_increment=0.0,
            scan_time=1.0 / laser.rate,
            range_min=laser.range_min,
            range_max=laser.range_max,
            ranges=mark.f4s("ranges", laser.rays),
            intensities=np.zeros(0, np.float32),
        )

    return derive("/scan", kind, build)


@functools.cache
def command() -> Layout:
    """``/cmd_vel``: vx, vy, wz in base_link."""
    kind = "geometry_msgs/msg/TwistStamped"
    return derive(
        "/cmd_vel",
        kind,
        lambda mark: ros.make(
            kind,
            header=ros.header(mark.stamp(), "base_link"),
            twist=ros.twist(mark.f8("vx"), mark.f8("vy"), mark.f8("wz")),
        ),
    )


@functools.cache
def estimate(topic: str) -> Layout:
    """``/pose`` and ``/particle_cloud/summary``: x, y, qz, qw and c0..c8 in map."""
    kind = "geometry_msgs/msg/PoseWithCovarianceStamped"

    def build(mark: Mark) -> Any:
        covariance = np.zeros(36)
        for i, slot in enumerate(COVARIANCE_SLOTS):
            covariance[slot] = mark.f8(f"c{i}")
        return ros.make(
            kind,
            header=ros.header(mark.stamp(), "map"),
            pose=ros.make(
                "geometry_msgs/msg/PoseWithCovariance",
                pose=ros.pose(mark.f8("x"), mark.f8("y"), mark.f8("qz"), mark.f8("qw")),
                covariance=covariance,
            ),
        )

    return derive(topic, kind, build)


@functools.cache
def count() -> Layout:
    """``/particle_cloud/count``: how many particles the summary of the same time stands for."""
    kind = "std_msgs/msg/UInt32"
    return derive("/particle_cloud/count", kind, lambda m: ros.make(kind, data=m.u4("count")))


@functools.lru_cache(maxsize=64)
def joints(names: tuple[str, ...]) -> Layout:
    """``/joint_states``: position (k,) and velocity (k,) of the named joints."""
    kind = "sensor_msgs/msg/JointState"
    return derive(
        "/joint_states",
        kind,
        lambda mark: ros.make(
            kind,
            header=ros.header(mark.stamp(), ""),
            name=list(names),
            position=mark.f8s("position", len(names)),
            velocity=mark.f8s("velocity", len(names)),
            effort=np.zeros(0),
        ),
    )


@functools.lru_cache(maxsize=1024)
def contact(first: str, second: str) -> Layout:
    """``/contacts`` with one contact between two named bodies: px, py, nx, ny, depth in map."""

    def build(mark: Mark) -> Any:
        nothing = ros.vector(0.0, 0.0)
        state = ros.make(
            "gazebo_msgs/msg/ContactState",
            info="",
            collision1_name=first,
            collision2_name=second,
            wrenches=[],
            total_wrench=ros.make("geometry_msgs/msg/Wrench", force=nothing, torque=nothing),
            contact_positions=[ros.vector(mark.f8("px"), mark.f8("py"))],
            contact_normals=[ros.vector(mark.f8("nx"), mark.f8("ny"))],
            depths=np.array([mark.f8("depth")]),
        )
        return ros.make(ros.CONTACTS, header=ros.header(mark.stamp(), "map"), states=[state])

    return derive("/contacts", ros.CONTACTS, build)


@functools.cache
def path(count: int) -> Layout:
    """A ``nav_msgs/Path`` in map with ``count`` poses: x0, y0, x1, ... (see ``paths``)."""
    kind = "nav_msgs/msg/Path"

    def build(mark: Mark) -> Any:
        return ros.make(
            kind,
            header=ros.header(mark.stamp("stamp"), "map"),
            poses=[
                ros.make(
                    "geometry_msgs/msg/PoseStamped",
                    header=ros.header(mark.stamp(f"stamp{i}"), "map"),
                    pose=ros.pose(mark.f8(f"x{i}"), mark.f8(f"y{i}"), 0.0, 1.0),
                )
                for i in range(count)
            ],
        )

    return derive("/plan", kind, build)
