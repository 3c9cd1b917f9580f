"""AMCL written to be read: plain numpy and loops, the measure of the compiled one."""

import math

import numpy as np

from grammars.model.geometry import wrap_angle
from grammars.model.grid import OCCUPIED

Cell = tuple[int, int]


def single(value):
    """Round to single precision, in which messages carry limits and ranges."""
    return float(np.float32(value))


def distances(grid, cap):
    """Distance [m] of every cell to the nearest occupied one, ``cap`` beyond ``cap``."""
    found = np.argwhere(grid.cells == OCCUPIED)
    if len(found) == 0:
        return np.full(grid.cells.shape, cap)
    rows, columns = np.indices(grid.cells.shape)
    away = np.hypot(rows[..., None] - found[:, 0], columns[..., None] - found[:, 1]).min(axis=-1)
    # Rounding errors aside, as many whole cells as fit under the cap.
    return np.where(away <= math.floor(cap / grid.resolution + 1e-6), away * grid.resolution, cap)


class Waiting:
    """The cells waiting in a ``std::priority_queue`` of libstdc++, nearest first.

    A binary heap in which equals are no neutral matter: of two equal children the second rises,
    and what is put in stops below an equal one.
    """

    def __init__(self):
        self.entries = []

    def push(self, entry):
        self.entries.append(entry)
        self._put(len(self.entries) - 1, entry)

    def pop(self):
        last = self.entries.pop()
        count, hole = len(self.entries), 0
        if not count:
            return
        while (below := [k for k in (2 * hole + 2, 2 * hole + 1) if k < count]) != []:
            nearest = min(below, key=lambda k: self.entries[k][0])
            self.entries[hole] = self.entries[nearest]
            hole = nearest
        self._put(hole, last)

    def _put(self, place, entry):
        while place and self.entries[(place - 1) // 2][0] > entry[0]:
            self.entries[place] = self.entries[(place - 1) // 2]
            place = (place - 1) // 2
        self.entries[place] = entry


def brushfire(grid, cap):
    """Return distances [m] as ``map_update_cspace`` spreads them, and how many cells were skipped.

    Those are nearer than the cell they were reached from, which is still in the queue: they leave
    it in its stead.
    """
    scale = single(grid.resolution)
    radius = int(cap / scale)
    away = np.full(grid.cells.shape, cap)
    marked, waiting, skipped = set[Cell](), Waiting(), 0
    rows, columns = grid.cells.shape
    for i in range(columns):
        for j in range(rows):
            if grid.cells[j, i] == OCCUPIED:
                away[j, i] = 0.0
                marked.add((i, j))
                waiting.push((0, (i, j), (i, j)))
    while waiting.entries:
        first = waiting.entries[0]
        (i, j), source = first[1:]
        for a, b in ((i - 1, j), (i, j - 1), (i + 1, j), (i, j + 1)):
            if not (0 <= a < columns and 0 <= b < rows) or (a, b) in marked:
                continue
            squared = (a - source[0]) ** 2 + (b - source[1]) ** 2
            if squared <= radius**2:
                away[b, a] = math.sqrt(squared) * scale
                marked.add((a, b))
                waiting.push((squared, (a, b), source))
        skipped += waiting.entries[0] != first
        waiting.pop()
    return away, skipped


def cell_of(grid, x, y):
    """Row and column as ``MAP_GXWX`` has them, about an origin in the middle of the map."""
    rows, columns = grid.cells.shape
    middle_x = grid.x + columns // 2 * grid.resolution
    middle_y = grid.y + rows // 2 * grid.resolution
    i = np.floor((x - middle_x) / grid.resolution + 0.5) + columns // 2
    j = np.floor((y - middle_y) / grid.resolution + 0.5) + rows // 2
    return j.astype(int), i.astype(int)


def beams(laser, maximum):
    return range(0, laser.rays, max(1, (laser.rays - 1) // (maximum - 1)))


def distances_at_ends(
    parameters, grid, field, laser, poses,
    ranges, indices):  # fmt: skip
    """Distance to the nearest obstacle at every usable beam's end, shape (particles, beams)."""
    bearings = np.linspace(laser.angle_min, laser.angle_max, laser.rays)
    columns = []
    for k in indices:
        r = float(ranges[k])
        if not single(laser.range_min) < r < single(laser.range_max):
            continue
        x = laser.mount.x + r * math.cos(laser.mount.yaw + bearings[k])
        y = laser.mount.y + r * math.sin(laser.mount.yaw + bearings[k])
        c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        j, i = cell_of(grid, poses[:, 0] + c * x - s * y, poses[:, 1] + s * x + c * y)
        on_map = (j >= 0) & (i >= 0) & (j < field.shape[0]) & (i < field.shape[1])
        away = np.full(len(poses), parameters.laser_likelihood_max_dist)
        away[on_map] = field[j[on_map], i[on_map]]
        columns.append(away)
    return np.array(columns).reshape(-1, len(poses)).T


def pz(parameters, laser, away):
    hit = np.exp(-(away**2) / (2.0 * parameters.laser_sigma_hit**2))
    return parameters.laser_z_hit * hit + parameters.laser_z_rand / single(laser.range_max)


def likelihood(
    parameters, grid, field, laser, poses,
    ranges):  # fmt: skip
    """p = 1 + sum pz^3 of each pose (n, 3)."""
    indices = beams(laser, parameters.laser_max_beams)
    away = distances_at_ends(parameters, grid, field, laser, poses, ranges, indices)
    return 1.0 + (pz(parameters, laser, away) ** 3).sum(axis=1)


def moved(p, poses, before, after, normals):
    """Poses (n, 3) after the motion; ``normals`` (3, n) in the order the model names its noise."""
    dx, dy = after.x - before.x, after.y - before.y
    rot, trans = wrap_angle(after.yaw - before.yaw), math.hypot(dx, dy)
    bearing = wrap_angle(math.atan2(dy, dx) - before.yaw)
    a1, a2, a3, a4, a5 = (getattr(p, f"odom_alpha{k}") for k in range(1, 6))
    spread = np.sqrt if p.odom_model_type.endswith("corrected") else np.asarray
    yaw = poses[:, 2]
    if p.odom_model_type.startswith("omni"):
        t = trans + spread(a3 * trans**2 + a4 * rot**2) * normals[0]
        r = rot + spread(a1 * rot**2 + a2 * trans**2) * normals[1]
        s = spread(a4 * rot**2 + a5 * trans**2) * normals[2]
        c = bearing + yaw
        x, y = t * np.cos(c) + s * np.sin(c), t * np.sin(c) - s * np.cos(c)
        return poses + np.column_stack((x, y, r))
    r1 = 0.0 if trans < 0.01 else bearing
    r2 = wrap_angle(rot - r1)
    n1, n2 = (min(abs(wrap_angle(r)), abs(wrap_angle(r - math.pi))) for r in (r1, r2))
    r1_hat = r1 - spread(a1 * n1**2 + a2 * trans**2) * normals[0]
    t_hat = trans - spread(a3 * trans**2 + a4 * n1**2 + a4 * n2**2) * normals[1]
    r2_hat = r2 - spread(a1 * n2**2 + a2 * trans**2) * normals[2]
    r1_hat, r2_hat = ((r + math.pi) % math.tau - math.pi for r in (r1_hat, r2_hat))
    x, y = t_hat * np.cos(yaw + r1_hat), t_hat * np.sin(yaw + r1_hat)
    return poses + np.column_stack((x, y, r1_hat + r2_hat))


def limit(p, bins):
    """Particles asked for by ``bins`` occupied bins (Fox 2003, equation 14)."""
    if bins <= 1:
        return p.max_particles
    b = 2.0 / (9.0 * (bins - 1))
    n = math.ceil((bins - 1) / (2.0 * p.kld_err) * (1.0 - b + math.sqrt(b) * p.kld_z) ** 3)
    return min(max(n, p.min_particles), p.max_particles)


def bin_of(pose):
    x, y, yaw = pose.tolist()
    return math.floor(x / 0.5), math.floor(y / 0.5), math.floor(yaw / (10.0 * math.pi / 180.0))


def resampled(p, poses, weights, draws):
    """Draw one at a time until there are more than the bins seen so far ask for."""
    cumulative = np.cumsum(weights)
    drawn = []
    seen = set()
    for r in draws:
        i = min(int(np.searchsorted(cumulative, r, side="right")), len(weights) - 1)
        drawn.append(poses[i])
        seen.add(bin_of(poses[i]))
        if len(drawn) > limit(p, len(seen)) or len(drawn) == p.max_particles:
            break
    return np.array(drawn)


def clusters(poses):
    """Cluster of every pose: connected components of occupied bins over 26 neighbours."""
    bins = [bin_of(pose) for pose in poses]
    occupied, labels = set(bins), {}
    for first in bins:
        if first in labels:
            continue
        number = max(labels.values(), default=-1) + 1
        waiting = [first]
        while waiting:
            a, b, c = waiting.pop()
            if (a, b, c) in labels or (a, b, c) not in occupied:
                continue
            labels[a, b, c] = number
            around = (-1, 0, 1)
            waiting += [(a + i, b + j, c + k) for i in around for j in around for k in around]
    return [labels[b] for b in bins]


def summary(poses, weights):
    """Estimate (3,), mean of all (3,) and covariance of all (3, 3)."""

    def mean(some, w):
        yaw = math.atan2(w @ np.sin(some[:, 2]), w @ np.cos(some[:, 2]))
        return np.array([*(w @ some[:, :2] / w.sum()), yaw])

    labels = np.array(clusters(poses))
    sizes = [weights[labels == k].sum() for k in range(labels.max() + 1)]
    best = labels == int(np.argmax(sizes))
    everything = mean(poses, weights)
    covariance = np.zeros((3, 3))
    off = poses[:, :2] - everything[:2]
    covariance[:2, :2] = (off * weights[:, None]).T @ off
    length = math.hypot(weights @ np.sin(poses[:, 2]), weights @ np.cos(poses[:, 2]))
    covariance[2, 2] = -2.0 * math.log(length)
    return mean(poses[best], weights[best]), everything, covariance


class PlainAmcl:
    """The likelihood-field filter without recovery: the same random numbers, none of the speed."""

    def __init__(
        self, parameters, grid, laser, start,
        seed, field):  # fmt: skip
        p = self.parameters = parameters
        self.grid, self.laser, self.field = grid, laser, field
        self.random = np.random.default_rng(np.random.SeedSequence(seed))
        sigma = np.sqrt([p.initial_cov_xx, p.initial_cov_yy, p.initial_cov_aa])
        normals = self.random.standard_normal((3, p.max_particles))
        self.poses = np.array([start.x, start.y, start.yaw]) + normals.T * sigma
        self.weights = np.full(p.max_particles, 1.0 / p.max_particles)
        self.last = None
        self.updates = 0

    def update(self, ranges, odom, laser=None):
        """Take a scan; tell whether particles were resampled. Every scan counts as a motion.

        ``laser`` is another one than the filter's own.
        """
        p = self.parameters
        if self.last is not None:
            normals = self.random.standard_normal(3 * len(self.poses)).reshape(3, -1)
            self.poses = moved(p, self.poses, self.last, odom, normals)
        self.last = odom
        self.weights = self.weights * likelihood(
            p, self.grid, self.field, laser or self.laser, self.poses, ranges
        )
        self.weights /= self.weights.sum()
        self.updates += 1
        if self.updates % p.resample_interval:
            return False
        draws = self.random.random(p.max_particles)
        self.poses = resampled(p, self.poses, self.weights, draws)
        self.weights = np.full(len(self.poses), 1.0 / len(self.poses))
        return True
