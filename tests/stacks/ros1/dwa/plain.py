"""The controller's sampling cycle as plainly as possible: every sample, every point, every critic.

Compiled only so that tests can afford it on full-size problems; there is no shortcut in it.
"""

import math

import numpy as np

from daemon.model.kernels import kernel


@kernel
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


@kernel
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


@kernel
def raw_samples(state, distance, s):
    """Return all samples in the original's order, shape (samples, 3), in single precision."""
    window = speed_window(state, distance, s)
    xs = _speeds(window[0, 0], window[0, 1], s.vx_samples)
    ys = _speeds(window[1, 0], window[1, 1], s.vy_samples)
    ws = _speeds(window[2, 0], window[2, 1], s.vth_samples)
    out = np.zeros((len(xs) * len(ys) * len(ws), 3), dtype=np.float32)
    i = 0
    for x in xs:
        for y in ys:
            for w in ws:
                out[i, 0], out[i, 1], out[i, 2] = x, y, w
                i += 1
    return out.astype(np.float64)


@kernel
def _approach(target, now, s, dt):
    acc = (s.acc_lim_x, s.acc_lim_y, s.acc_lim_theta)
    out = np.zeros(3, dtype=np.float32)
    for k in range(3):
        if now[k] < target[k]:
            out[k] = min(target[k], now[k] + acc[k] * dt)
        else:
            out[k] = max(target[k], now[k] - acc[k] * dt)
    return out.astype(np.float64)


@kernel
def trajectory(state, sample, s):
    """Return the poses (points, 3), none for an illegal sample, and the velocity."""
    none = np.zeros((0, 3))
    speed = math.hypot(sample[0], sample[1])
    if speed + 1e-4 < s.min_vel_trans and abs(sample[2]) + 1e-4 < s.min_vel_theta:
        return none, np.zeros(3)
    if speed - 1e-4 > s.max_vel_trans:
        return none, np.zeros(3)
    by_way = speed * s.sim_time / s.sim_granularity
    by_turn = abs(sample[2]) * s.sim_time / s.angular_sim_granularity
    n = math.ceil(max(by_way, by_turn))
    if n == 0:
        return none, np.zeros(3)
    dt = s.sim_time / n
    velocity = sample.copy()
    if not s.use_dwa:
        velocity = _approach(sample, state[3:], s, dt)
    first = velocity.copy()
    points = np.zeros((n, 3))
    pose = state[:3].astype(np.float32)
    for i in range(n):
        points[i] = pose.astype(np.float64)
        if not s.use_dwa:
            velocity = _approach(sample, velocity, s, dt)
        x, y, yaw = points[i]
        vx, vy, w = velocity
        pose[0] = x + (vx * math.cos(yaw) + vy * math.cos(math.pi / 2 + yaw)) * dt
        pose[1] = y + (vx * math.sin(yaw) + vy * math.sin(math.pi / 2 + yaw)) * dt
        pose[2] = yaw + w * dt
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


@kernel
def resampled(plan, resolution):
    out = [(plan[0, 0], plan[0, 1])]
    for i in range(1, len(plan)):
        ax, ay, bx, by = plan[i - 1, 0], plan[i - 1, 1], plan[i, 0], plan[i, 1]
        square = (bx - ax) * (bx - ax) + (by - ay) * (by - ay)
        if square > resolution * resolution:
            steps = math.ceil(math.sqrt(square) / resolution)
            dx, dy = (bx - ax) / steps, (by - ay) / steps
            for j in range(1, steps):
                out.append((ax + j * dx, ay + j * dy))  # noqa: PERF401
        out.append((bx, by))
    return np.array(out)


@kernel
def seeds_of(plan, cells, frame):
    """Return the known cells of a plan from the first one until it leaves them."""
    found = [(0, 0)][:0]
    for x, y in resampled(plan, frame[2]):
        row, column = cell(x, y, cells, frame)
        if row >= 0 and cells[row, column] != 255:
            found.append((row, column))
        elif len(found) > 0:
            break
    out = np.zeros((len(found), 2), dtype=np.int32)
    for i, (row, column) in enumerate(found):
        out[i, 0], out[i, 1] = row, column
    return out


@kernel
def distances(seeds, cells):
    """Return the steps from the nearest seed, by a queue."""
    rows, columns = cells.shape
    out = np.full((rows, columns), rows * columns + 1, dtype=np.int32)
    marked = np.zeros((rows, columns), dtype=np.bool_)
    queue = [(0, 0)][:0]
    for i in range(len(seeds)):
        row, column = int(seeds[i, 0]), int(seeds[i, 1])
        out[row, column] = 0
        marked[row, column] = True
        queue.append((row, column))
    at = 0
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
def under(outline, scale, pose, cells, frame, inside):
    """Return the highest cost under the footprint and the centre, -1 when it cannot be there."""
    row, column = cell(pose[0], pose[1], cells, frame)
    if row < 0:
        return -1
    worst = int(cells[row, column])
    if len(outline) < 3:
        return worst if worst < 253 else -1
    c, d = math.cos(pose[2]), math.sin(pose[2])
    corners = [(0, 0)][:0]
    for k in range(len(outline)):
        x, y = scale * outline[k, 0], scale * outline[k, 1]
        at = cell(pose[0] + (x * c - y * d), pose[1] + (x * d + y * c), cells, frame)
        if at[0] < 0:
            return -1
        corners.append(at)
    touched = np.zeros(cells.shape, dtype=np.bool_)
    for k in range(len(corners)):
        for y, x in line(corners[k], corners[(k + 1) % len(corners)]):
            touched[y, x] = True
    for y in range(cells.shape[0]):
        found = np.flatnonzero(touched[y])
        if len(found) == 0:
            continue
        for x in range(found[0], found[-1] + 1):
            if inside or touched[y, x]:
                if cells[y, x] >= 254:
                    return -1
                worst = max(worst, int(cells[y, x]))
    return worst


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
    for pose in points:
        cost = under(outline, scale, pose, cells, frame, not s.perimeter_only)
        if cost < 0:
            return -6.0
        worst = max(worst, float(cost))
        total += cost
    return total if s.sum_scores else worst


@kernel
def on_grid(points, grid, cells, frame, shift, strict):
    """Return the distance at the last point, each of them ``shift`` ahead; negative: illegal."""
    value = 0.0
    for pose in points:
        x, y = pose[0], pose[1]
        if shift != 0.0:
            x, y = x + shift * math.cos(pose[2]), y + shift * math.sin(pose[2])
        row, column = cell(x, y, cells, frame)
        if row < 0:
            return -4.0
        value = float(grid[row, column])
        if strict and value == cells.size:
            return -3.0
        if strict and value == cells.size + 1:
            return -2.0
    return value


@kernel
def costs(state, plan, front_end, aligned, s, cells, frame, outline, banned):
    """Return the cost of every sample, infinite where it is illegal."""
    seeds = seeds_of(plan, cells, frame)
    path = distances(seeds, cells)
    goal = distances(seeds[-1:], cells)
    front_plan = plan.copy()
    front_plan[-1] = front_end
    front = distances(seeds_of(front_plan, cells, frame)[-1:], cells)
    distance = math.hypot(plan[-1, 0] - state[0], plan[-1, 1] - state[1])
    samples = raw_samples(state, distance, s)
    out = np.full(len(samples), np.inf)
    for index in range(len(samples)):
        points, velocity = trajectory(state, samples[index], s)
        if len(points) == 0 or oscillates(banned, velocity):
            continue
        terms = np.zeros(6)
        scales = np.zeros(6)
        scales[0], scales[1], scales[2] = s.occdist_scale, s.goal_scale, s.path_scale
        scales[3], scales[4], scales[5] = s.path_scale, s.goal_scale, s.twirling_scale
        if not aligned:
            scales[2] = 0.0
        if scales[0] != 0:
            terms[0] = obstacle(points, velocity, outline, cells, frame, s)
        if scales[1] != 0:
            terms[1] = on_grid(points, front, cells, frame, s.forward_point_distance, False)
        if scales[2] != 0:
            terms[2] = on_grid(points, path, cells, frame, s.forward_point_distance, False)
        if scales[3] != 0:
            terms[3] = on_grid(points, path, cells, frame, 0.0, True)
        if scales[4] != 0:
            terms[4] = on_grid(points, goal, cells, frame, 0.0, True)
        terms[5] = abs(velocity[2])
        if terms.min() < 0.0:
            continue
        total = 0.0
        for k in range(6):
            if scales[k] != 0:
                total += terms[k] * scales[k]
        out[index] = total
    return out
