"""The controller's sampling cycle as plainly as possible: every sample, every point, every critic.

What is done for each sample is compiled, so that tests can afford it on full-size problems; there
is no shortcut in it. Slices, lists of lists and whole arrays are avoided there: they take seconds
to compile.
"""

import math
from itertools import pairwise, product

import numpy as np

from daemon.model.kernels import kernel


def _speeds(low, high, count):
    if low == high:
        return [low]
    count = max(count, 2)
    step = (high - low) / (count - 1)
    values = [low]
    for _ in range(count - 2):
        values.append(values[-1] + step)
    out = [values[0]]
    following = low + step
    for i in range(1, len(values) + 1):
        if values[i - 1] < 0.0 and following > 0.0:
            out.append(0.0)
        if i < len(values):
            out.append(values[i])
            following = values[i] + step
    out.append(high)
    return out


def speed_window(state, distance, s):
    acc = (s.acc_lim_x, s.acc_lim_y, s.acc_lim_theta)
    low = [s.min_vel_x, s.min_vel_y, -s.max_vel_theta]
    high = [s.max_vel_x, s.max_vel_y, s.max_vel_theta]
    time = s.period if s.use_dwa else s.sim_time
    if not s.use_dwa:
        high[0] = max(min(high[0], distance / s.sim_time), low[0])
        high[1] = max(min(high[1], distance / s.sim_time), low[1])
    out = np.zeros((3, 2), dtype=np.float32)
    for k in range(3):
        out[k, 0] = max(low[k], state[3 + k] - acc[k] * time)
        out[k, 1] = min(high[k], state[3 + k] + acc[k] * time)
    if not s.strafe_leaks:
        out[1, 0] = min(out[1, 0], np.float32(high[1]))
        out[1, 1] = max(out[1, 1], np.float32(low[1]))
    return out.astype(np.float64)


def raw_samples(state, distance, s):
    """Return all samples in the original's order, shape (samples, 3), in single precision."""
    window = speed_window(state, distance, s).tolist()
    counts = (s.vx_samples, s.vy_samples, s.vth_samples)
    axes = [_speeds(*ends, count) for ends, count in zip(window, counts, strict=True)]
    return np.array(list(product(*axes)), dtype=np.float32).astype(np.float64)


@kernel
def _approach(target, now, s, dt):
    """Bring three speeds nearer to those of a sample."""
    acc = (s.acc_lim_x, s.acc_lim_y, s.acc_lim_theta)
    for k in range(3):
        if now[k] < target[k]:
            now[k] = np.float32(min(target[k], now[k] + acc[k] * dt))
        else:
            now[k] = np.float32(max(target[k], now[k] - acc[k] * dt))


@kernel
def trajectory(state, sample, s):
    """Return the poses (points, 3), none for an illegal sample, and the velocity."""
    speed = math.hypot(sample[0], sample[1])
    by_way = speed * s.sim_time / s.sim_granularity
    by_turn = abs(sample[2]) * s.sim_time / s.angular_sim_granularity
    n = math.ceil(max(by_way, by_turn))
    if speed + 1e-4 < s.min_vel_trans and abs(sample[2]) + 1e-4 < s.min_vel_theta:
        n = 0
    if speed - 1e-4 > s.max_vel_trans:
        n = 0
    points, first, velocity = np.zeros((n, 3)), np.zeros(3), np.zeros(3)
    if n == 0:
        return points, first
    dt = s.sim_time / n
    for k in range(3):
        velocity[k] = sample[k] if s.use_dwa else state[3 + k]
    if not s.use_dwa:
        _approach(sample, velocity, s, dt)
    for k in range(3):
        first[k] = velocity[k]
    x, y, yaw = state[0], state[1], state[2]
    for i in range(n):
        points[i, 0], points[i, 1], points[i, 2] = np.float32(x), np.float32(y), np.float32(yaw)
        x, y, yaw = points[i, 0], points[i, 1], points[i, 2]
        if not s.use_dwa:
            _approach(sample, velocity, s, dt)
        vx, vy, w = velocity[0], velocity[1], velocity[2]
        x += (vx * math.cos(yaw) + vy * math.cos(math.pi / 2 + yaw)) * dt
        y += (vx * math.sin(yaw) + vy * math.sin(math.pi / 2 + yaw)) * dt
        yaw += w * dt
    return points, first


@kernel
def cell(x, y, cells, frame):
    """Return row and column, (-1, -1) off the grid."""
    if x < frame[0] or y < frame[1]:
        return -1, -1
    column, row = int((x - frame[0]) / frame[2]), int((y - frame[1]) / frame[2])
    if row >= cells.shape[0] or column >= cells.shape[1]:
        return -1, -1
    return row, column


def resampled(plan, resolution):
    out = [tuple(plan[0].tolist())]
    for (ax, ay), (bx, by) in pairwise(plan.tolist()):
        square = (bx - ax) * (bx - ax) + (by - ay) * (by - ay)
        if square > resolution * resolution:
            steps = math.ceil(math.sqrt(square) / resolution)
            dx, dy = (bx - ax) / steps, (by - ay) / steps
            for j in range(1, steps):
                out.append((ax + j * dx, ay + j * dy))  # noqa: PERF401
        out.append((bx, by))
    return out


def seeds_of(plan, cells, frame):
    """Return the known cells of a plan from the first one until it leaves them."""
    found = []
    for x, y in resampled(plan, float(frame[2])):
        row, column = cell(x, y, cells, frame)
        if row >= 0 and cells[row, column] != 255:
            found.append((row, column))
        elif found:
            break
    return np.array(found, dtype=np.int32).reshape(-1, 2)


@kernel
def distances(seeds, cells):
    """Return the steps from the nearest seed, by a queue."""
    rows, columns = cells.shape
    out = np.full((rows, columns), rows * columns + 1, dtype=np.int32)
    marked = np.zeros((rows, columns), dtype=np.bool_)
    queue = [(-1, -1)]
    for i in range(len(seeds)):
        row, column = int(seeds[i, 0]), int(seeds[i, 1])
        out[row, column] = 0
        marked[row, column] = True
        queue.append((row, column))
    at = 1
    while at < len(queue):
        row, column = queue[at]
        at += 1
        for dy, dx in ((0, -1), (0, 1), (-1, 0), (1, 0)):
            y, x = row + dy, column + dx
            if y < 0 or x < 0 or y >= rows or x >= columns or marked[y, x]:
                continue
            marked[y, x] = True
            if cells[y, x] >= 253:
                out[y, x] = rows * columns
            else:
                out[y, x] = out[row, column] + 1
                queue.append((y, x))
    return out


@kernel
def line(a, b):
    """Return the cells (row, column) of Bresenham's line, with both ends."""
    y, x = a
    dx, dy = abs(b[1] - x), abs(b[0] - y)
    sx = 1 if b[1] >= x else -1
    sy = 1 if b[0] >= y else -1
    out = [(y, x)]
    if dx >= dy:
        rest = dx // 2
        for _ in range(dx):
            rest += dy
            if rest >= dx:
                rest -= dx
                y += sy
            x += sx
            out.append((y, x))
    else:
        rest = dy // 2
        for _ in range(dy):
            rest += dx
            if rest >= dy:
                rest -= dy
                x += sx
            y += sy
            out.append((y, x))
    return out


@kernel
def under(x, y, yaw, outline, scale, cells, frame, inside):
    """Return the highest cost under the footprint and the centre, -1 when it cannot be there."""
    row, column = cell(x, y, cells, frame)
    if row < 0:
        return -1
    centre, worst = int(cells[row, column]), 0
    if len(outline) < 3:
        return centre if centre < 253 else -1
    c, d = math.cos(yaw), math.sin(yaw)
    corners = [(-1, -1)]
    for k in range(len(outline)):
        u, v = scale * outline[k, 0], scale * outline[k, 1]
        at = cell(x + (u * c - v * d), y + (u * d + v * c), cells, frame)
        if at[0] < 0:
            return -1
        corners.append(at)
    corners[0] = corners[-1]
    first, last = np.full(len(cells), cells.size), np.full(len(cells), -1)
    for k in range(len(outline)):
        for i, j in line(corners[k], corners[k + 1]):
            worst = max(worst, int(cells[i, j]))
            first[i], last[i] = min(first[i], j), max(last[i], j)
    if inside:
        for i in range(len(cells)):
            for j in range(first[i], last[i] + 1):
                worst = max(worst, int(cells[i, j]))
    return max(worst, centre) if worst < 254 else -1


@kernel
def oscillates(banned, velocity):
    for k in range(3):
        if banned[2 * k] and velocity[k] < 0:
            return True
        if banned[2 * k + 1] and velocity[k] > 0:
            return True
    return False


@kernel
def obstacle(points, velocity, outline, cells, frame, s):
    speed = math.hypot(velocity[0], velocity[1])
    scale = 1.0
    if speed > s.scaling_speed and s.max_scaling_factor != 0.0:
        beyond = s.max_vel_trans - s.scaling_speed
        scale = s.max_scaling_factor * (speed - s.scaling_speed) / beyond + 1.0
    worst, total = 0.0, 0.0
    for i in range(len(points)):
        x, y, yaw = points[i, 0], points[i, 1], points[i, 2]
        cost = under(x, y, yaw, outline, scale, cells, frame, not s.perimeter_only)
        if cost < 0:
            return -6.0
        worst = max(worst, float(cost))
        total += cost
    return total if s.sum_scores else worst


@kernel
def on_grid(points, grid, cells, frame, shift, strict):
    """Return the distance at the last point, each of them ``shift`` ahead; negative: illegal."""
    value = 0.0
    for i in range(len(points)):
        x, y, yaw = points[i, 0], points[i, 1], points[i, 2]
        if shift != 0.0:
            x, y = x + shift * math.cos(yaw), y + shift * math.sin(yaw)
        row, column = cell(x, y, cells, frame)
        if row < 0:
            return -4.0
        value = float(grid[row, column])
        if strict and value == cells.size:
            return -3.0
        if strict and value == cells.size + 1:
            return -2.0
    return value


def costs(state, plan, front_end, aligned, s, cells, frame, outline, banned):
    """Return the cost of every sample, infinite where it is illegal."""
    ahead = np.vstack([plan[:-1], front_end])
    seeds, front = (seeds_of(points, cells, frame) for points in (plan, ahead))
    grids = [distances(found, cells) for found in (seeds, seeds[-1:], front[-1:])]
    samples = raw_samples(state, math.hypot(*(plan[-1] - state[:2]).tolist()), s)
    return _costs(state, samples, *grids, aligned, s, cells, frame, outline, banned)


@kernel
def _costs(state, samples, path, goal, front, aligned, s, cells, frame, outline, banned):
    grids, ahead = (front, path, path, goal), s.forward_point_distance
    scales = (s.goal_scale, s.path_scale if aligned else 0.0, s.path_scale, s.goal_scale)
    out = np.full(len(samples), np.inf)
    for index in range(len(samples)):
        points, velocity = trajectory(state, samples[index], s)
        legal, total = len(points) > 0 and not oscillates(banned, velocity), 0.0
        if legal and s.occdist_scale != 0:
            cost = obstacle(points, velocity, outline, cells, frame, s)
            legal, total = cost >= 0.0, cost * s.occdist_scale
        for k in range(4):
            if legal and scales[k] != 0:
                cost = on_grid(points, grids[k], cells, frame, 0.0 if k > 1 else ahead, k > 1)
                legal, total = cost >= 0.0, total + cost * scales[k]
        if legal:
            out[index] = total + abs(velocity[2]) * s.twirling_scale
    return out
