"""Transforms and scans by stamp: what a node knew at an instant, whenever it was told."""

from collections import deque

import numpy as np
from standin_nodes.localization import FUTURE
from standin_nodes.poses import compose, from_transform, nanoseconds

_LAG = 100_000_000
"""How old [ns] the newest map->odom is that may be used: amcl has this long to make it."""


class Series:
    """Values by stamp [ns], of something that comes about every so often."""

    def __init__(self):
        self._values = deque(maxlen=200)

    def add(self, stamp, value):
        """Keep a value; what is not newer than the last one is dropped, after a reset all else."""
        if self._values and stamp < self._values[-1][0] - 5_000_000_000:
            self._values.clear()
        if not self._values or stamp > self._values[-1][0]:
            self._values.append((stamp, value))

    @property
    def newest(self):
        """The newest stamp."""
        return self._values[-1][0] if self._values else None

    def at(self, time):
        """The newest with a stamp of at most `time`."""
        return next((entry for entry in reversed(self._values) if entry[0] <= time), None)

    def complete(self, time):
        """Whether no value up to `time` is outstanding, going by the rate seen so far."""
        if not self._values:
            return False
        newest = self._values[-1][0]
        if newest >= time or len(self._values) < 2:
            return True
        return newest + (newest - self._values[-2][0]) > time


class Sensed:
    """What the controller and the planner know of robot and surroundings."""

    def __init__(self, options):
        self._options = options
        self._odometry = Series()
        self._corrections = Series()
        self._scans = Series()
        self._laser = (0.0, 0.0, 0.0)

    def on_transforms(self, message):
        """Take odom->base, map->odom and base->laser out of a message of /tf or /tf_static."""
        options = self._options
        for each in message.transforms:
            stamp, pose = nanoseconds(each.header.stamp), from_transform(each.transform)
            link = (each.header.frame_id, each.child_frame_id)
            if link == (options.odom_frame, options.base_frame):
                self._odometry.add(stamp, pose)
            elif link == (options.global_frame, options.odom_frame):
                self._corrections.add(stamp - FUTURE, pose)
            elif link[0] == options.base_frame:
                self._laser = pose

    def on_scan(self, message):
        """Keep a scan."""
        self._scans.add(nanoseconds(message.header.stamp), message)

    @property
    def connected(self):
        """Whether there is a way of transforms from the map to the robot."""
        return None not in (self._odometry.newest, self._corrections.newest)

    def reaches(self, time):
        """Whether the odometry goes up to `time`."""
        newest = self._odometry.newest
        return newest is not None and newest >= time

    def complete(self, time):
        """Whether everything that a tick at `time` uses has come."""
        if not (self._odometry.complete(time) and self._scans.complete(time)):
            return False
        scan = self._scans.at(time - _LAG)
        if scan is None:
            return True
        return self._corrections.at(scan[0]) is not None and self._corrections.complete(scan[0])

    def pose(self, time):
        """Of the robot in the map, at `time`."""
        odometry, correction = self._odometry.at(time), self._corrections.at(time - _LAG)
        if odometry is None or correction is None:
            return None
        return compose(correction[1], odometry[1])

    def room_ahead(self, time, width):
        """How far the way straight ahead is free [m], from the centre of the robot.

        `width` is the half of the corridor that counts [m]; infinity without a scan.
        """
        found = self._scans.at(time)
        if found is None:
            return float("inf")
        scan = found[1]
        ranges = np.array(scan.ranges)
        angles = scan.angle_min + scan.angle_increment * np.arange(len(ranges)) + self._laser[2]
        x = self._laser[0] + ranges * np.cos(angles)
        y = self._laser[1] + ranges * np.sin(angles)
        ahead = np.isfinite(ranges) & (ranges >= scan.range_min) & (x > 0) & (np.abs(y) < width)
        return float(x[ahead].min()) if ahead.any() else float("inf")
