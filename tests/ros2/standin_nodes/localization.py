"""map_server and amcl: the map, and where the robot is on it."""

import math
from collections import deque
from pathlib import Path

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import LaserScan
from standin_nodes.grid import DistanceField, from_message, read_map
from standin_nodes.lifecycle import LifecycleNode
from standin_nodes.poses import (
    compose,
    fill_pose,
    fill_stamp,
    fill_transform,
    from_pose,
    from_transform,
    inverse,
    nanoseconds,
    wrap,
)
from tf2_msgs.msg import TFMessage

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TF_TOPIC, TF_STATIC_TOPIC = "/tf", "/tf_static"
TF_QOS = QoSProfile(depth=100)

FUTURE = 1_000_000_000
"""amcl stamps its transform this far ahead [ns] (`transform_tolerance` of Nav2's parameters)."""


class MapServer(LifecycleNode):
    """Publishes the map that it is given, latched, when activated."""

    def __init__(self, options):
        super().__init__("map_server", options)
        self._maps = self.create_publisher(OccupancyGrid, "map", LATCHED)

    async def on_activate(self):
        """Read the file and publish it."""
        file = Path(self.options.map)
        if not file.is_file():
            self.get_logger().error(f"Failed to load map yaml file: {file}")
            return False
        grid = read_map(file)
        message = OccupancyGrid()
        message.header.frame_id = self.options.global_frame
        fill_stamp(message.header.stamp, self.now)
        message.info.resolution = float(grid.resolution)
        message.info.height, message.info.width = grid.cells.shape
        message.info.origin.position.x = float(grid.x)
        message.info.origin.position.y = float(grid.y)
        message.info.origin.orientation.w = 1.0
        message.data = grid.cells.ravel().tolist()
        self._maps.publish(message)
        return True


class Localization(LifecycleNode):
    """amcl: map->odom from the initial pose, corrected by scan matching after some motion.

    Without an initial pose nothing is published, as with Nav2. A scan corrects only when the
    robot has moved 0.1 m or 0.1 rad since the last correction; so a robot that stands still gets
    the same transform however many scans it was shown, and runs repeat.
    """

    def __init__(self, options):
        super().__init__("amcl", options)
        self._field = None
        self._odometry = deque(maxlen=200)
        self._scans = deque(maxlen=20)
        self._laser = (0.0, 0.0, 0.0)
        self._initial = None
        self._correction = None
        self._corrected_at = None
        self._poses = self.create_publisher(PoseWithCovarianceStamped, "amcl_pose", LATCHED)
        self._transforms = self.create_publisher(TFMessage, TF_TOPIC, TF_QOS)
        self.create_subscription(TFMessage, TF_TOPIC, self._on_transforms, TF_QOS)
        self.create_subscription(TFMessage, TF_STATIC_TOPIC, self._on_transforms, LATCHED)
        self.create_subscription(LaserScan, "scan", self._on_scan, qos_profile_sensor_data)
        self.create_subscription(OccupancyGrid, "map", self._on_map, LATCHED)
        self.create_subscription(
            PoseWithCovarianceStamped, "initialpose", self._on_initial_pose, 10
        )

    def on_deactivate(self):
        """Forget the initial pose, so that the next run has to give its own."""
        self._initial = self._correction = self._corrected_at = None
        self._odometry.clear()
        self._scans.clear()

    def _on_map(self, message):
        grid = from_message(message)
        self._field = DistanceField(grid, grid.cells == 100)

    def _on_initial_pose(self, message):
        if message.header.frame_id != self.options.global_frame:
            self.get_logger().warning(
                f'Ignoring initial pose in frame "{message.header.frame_id}"; it must be in'
                f' the global frame, "{self.options.global_frame}"'
            )
            return
        pose = from_pose(message.pose.pose)
        if pose != self._initial:
            self.get_logger().info(f"Setting pose: {pose[0]:.3f} {pose[1]:.3f} {pose[2]:.3f}")
            self._initial, self._correction = pose, None

    def _on_transforms(self, message):
        for each in message.transforms:
            pose = from_transform(each.transform)
            if each.child_frame_id == self.options.base_frame:
                self._odometry.append((nanoseconds(each.header.stamp), pose))
            elif each.header.frame_id == self.options.base_frame:
                self._laser = pose
        self._use_scans()

    def _on_scan(self, message):
        self._scans.append(message)
        self._use_scans()

    def _use_scans(self):
        """Take the scans whose odometry is known, in order."""
        while self._scans and self._odometry:
            stamp = nanoseconds(self._scans[0].header.stamp)
            if self._odometry[-1][0] < stamp:
                return
            scan = self._scans.popleft()
            before = [pose for time, pose in self._odometry if time <= stamp]
            if before and self.active and self._initial is not None:
                self._locate(stamp, before[-1], scan)

    def _locate(self, stamp, odometry, scan):
        if self._correction is None or self._corrected_at is None:
            self._correction = compose(self._initial, inverse(odometry))
            self._corrected_at = odometry
            self._publish_pose(stamp, self._initial)
        moved = compose(inverse(self._corrected_at), odometry)
        if self._field and (math.hypot(*moved[:2]) > 0.1 or abs(moved[2]) > 0.1):
            guess = compose(self._correction, odometry)
            found = self._field.match(guess, self._points(scan))
            if math.hypot(found[0] - guess[0], found[1] - guess[1]) < 0.3:
                self._correction = compose(found, inverse(odometry))
            self._corrected_at = odometry
            self._publish_pose(stamp, compose(self._correction, odometry))
        self._publish_transform(stamp)

    def _points(self, scan):
        """End points in the base frame, shape (n, 2)."""
        ranges = np.array(scan.ranges)
        angles = scan.angle_min + scan.angle_increment * np.arange(len(ranges)) + self._laser[2]
        good = np.isfinite(ranges) & (ranges > scan.range_min) & (ranges < scan.range_max)
        ends = ranges[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        return ends[good] + self._laser[:2]

    def _publish_transform(self, stamp):
        if self.options.has("no-tf"):
            return
        message = TransformStamped()
        wrong = self.options.has("wrong-frame")
        message.header.frame_id = "world" if wrong else self.options.global_frame
        message.child_frame_id = self.options.odom_frame
        fill_stamp(message.header.stamp, stamp + FUTURE)
        fill_transform(message.transform, self._correction)
        self._transforms.publish(TFMessage(transforms=[message]))

    def _publish_pose(self, stamp, pose):
        message = PoseWithCovarianceStamped()
        message.header.frame_id = self.options.global_frame
        fill_stamp(message.header.stamp, stamp)
        fill_pose(message.pose.pose, (pose[0], pose[1], wrap(pose[2])))
        message.pose.covariance[0] = message.pose.covariance[7] = 0.01
        message.pose.covariance[35] = 0.005
        self._poses.publish(message)
