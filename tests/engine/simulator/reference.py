"""Independent ways to compute a laser scan."""

import numpy as np

from grammars.model.geometry import Pose2


def world_segments(world):
    """All laser segments in the world frame, shape (n, 4), moving ones at their present place."""
    plane, table = world._scanner(None)._plane, world._bodies.at(world.tick)
    rows = [tuple(row) for row in plane.static.tolist()]
    for (x1, y1, x2, y2), slot in zip(
        plane.moving.tolist(), plane.moving_slot.tolist(), strict=True
    ):
        frame = Pose2(*table[slot, :3].tolist())
        rows.append((*frame.apply((x1, y1)), *frame.apply((x2, y2))))
    return np.array(rows).reshape(-1, 4)


def true_ranges(world, laser=None):
    """Return the ranges [m] a scan is made from, inf where the laser meets nothing."""
    scanner = world._scanner(laser)
    scanner._cast(world.pose(), world._bodies.at(world.tick), world._bodies.version)
    nothing = 1.0 / scanner._laser.range_max
    return np.where(scanner._inverse > nothing, 1.0 / scanner._inverse, np.inf)


def ray_angles(laser, base):
    """World directions of all rays [rad]."""
    return (base @ laser.mount).yaw + np.linspace(laser.angle_min, laser.angle_max, laser.rays)


def cast_by_broadcast(segments, origin, angles):
    """Intersect every ray with every segment (closed, no tolerance); inf where none is hit."""
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    px, py = segments[:, 0] - origin[0], segments[:, 1] - origin[1]
    ex, ey = segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]
    with np.errstate(all="ignore"):
        across = c * ey - s * ex
        ranges = (px * ey - py * ex) / across
        along = (px * s - py * c) / across
        hit = (ranges > 0.0) & (along >= 0.0) & (along <= 1.0)
    return np.where(hit, ranges, np.inf).min(axis=1, initial=np.inf)


def near_an_end(segments, origin, angles, width=1e-7):
    """Rays that pass a segment's end within ``width`` radians: a silhouette, either is right."""
    ends = segments.reshape(-1, 2) - np.array(origin)
    bearings = np.arctan2(ends[:, 1], ends[:, 0])
    turn = np.abs(np.angle(np.exp(1j * (angles[:, None] - bearings[None, :]))))
    return np.asarray((turn < width).any(axis=1))
