"""The controller's search as plainly as possible, in the original's order: every trajectory in
turn, every point of it, and the flags one by one."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, field

import numpy as np

from tests.stacks.ros1.dwa import plain

Velocity = tuple[float, float, float]


@dataclass
class Trajectory:
    velocity: Velocity = (0.0, 0.0, 0.0)
    cost: float = -1.0
    points: list[Velocity] = field(default_factory=list)


def between(start, end):
    rest = math.fmod(end - start + math.pi, 2.0 * math.pi)
    return rest + math.pi if rest <= 0.0 else rest - math.pi


def length(x, y):
    return float(np.hypot(x, y))


def under_robot(state, outline, cells, frame):
    """Return the cells (row, column) of the outline, and between them in every column."""
    c, d = math.cos(state[2]), math.sin(state[2])
    corners = []
    for x, y in outline.tolist():
        at = plain.cell(state[0] + (x * c - y * d), state[1] + (x * d + y * c), cells, frame)
        corners.append(at)
    found = set()
    for k, at in enumerate(corners):
        to = corners[(k + 1) % len(corners)]
        if at[0] < 0 or to[0] < 0:
            return found
        found |= set(plain.line(at, to))
    for column in {column for _, column in found}:
        rows = [row for row, other in found if other == column]
        found |= {(row, column) for row in range(min(rows), max(rows))}
    return found


class PlainPlanner:
    """``TrajectoryPlanner::findBestPath`` with its memory."""

    def __init__(self, s, strafes, outline):
        self.s, self.strafes, self.outline = s, strafes, outline
        self.reset_after = self.escape_after = self.escape_turn = 0.0
        self.flags = dict.fromkeys(
            (f"{what}_{side}" for what in ("rotating", "strafe") for side in ("left", "right")),
            False,
        )
        self.stuck = dict.fromkeys(("left", "right", "left_strafe", "right_strafe"), False)
        self.escaping = False
        self.at = (0.0, 0.0)
        self.escaped_at = (0.0, 0.0, 0.0)

    def best(self, state, plan, local):
        self.state, self.plan, self.cells = state, plan, local.cells
        self.frame = np.array((local.x, local.y, local.resolution))
        seeds = plain.seeds_of(plan, self.cells, self.frame)
        freed = self.cells.copy()
        for row, column in under_robot(state, self.outline, self.cells, self.frame):
            freed[row, column] = 0
        self.path = plain.distances(seeds, freed)
        self.goal = plain.distances(seeds[-1:], self.cells)
        found = self.search()
        if found.cost == -1.0:
            found.cost = 1.0
        return found

    def trajectory(self, velocity):
        s, size = self.s, self.cells.size
        out = Trajectory(velocity)
        vx, vy, wz = velocity
        if s.heading_scoring:
            steps = int(s.sim_time / s.sim_granularity + 0.5)
        else:
            way = length(vx, vy) * s.sim_time / s.sim_granularity
            steps = int(max(way, abs(wz) / s.angular_sim_granularity) + 0.5)
        steps = max(steps, 1)
        dt, time = s.sim_time / steps, 0.0
        x, y, yaw, ux, uy, uw = self.state.tolist()
        path = goal = heading = worst = 0.0
        for _ in range(steps):
            row, column = plain.cell(x, y, self.cells, self.frame)
            if row < 0:
                return out
            cost = plain.under(
                x, y, yaw, self.outline, 1.0, self.cells, self.frame, not s.perimeter_only
            )
            if cost < 0:
                return out
            worst = max(worst, float(cost), float(self.cells[row, column]))
            instant = s.heading_scoring_timestep
            now = not s.heading_scoring or instant <= time < instant + dt
            if now and s.heading_scoring:
                heading = self.heading_error((row, column), x, y, yaw)
            if now:
                path, goal = float(self.path[row, column]), float(self.goal[row, column])
                if size <= goal or size <= path:
                    out.cost = -2.0
                    return out
            out.points.append((x, y, yaw))
            limits = (s.acc_lim_x, s.acc_lim_y, s.acc_lim_theta)
            ux, uy, uw = (
                min(to, v + a * dt) if to - v >= 0.0 else max(to, v - a * dt)
                for to, v, a in zip(velocity, (ux, uy, uw), limits, strict=True)
            )
            side = math.pi / 2.0 + yaw
            x, y, yaw = (
                x + (ux * math.cos(yaw) + uy * math.cos(side)) * dt,
                y + (ux * math.sin(yaw) + uy * math.sin(side)) * dt,
                yaw + uw * dt,
            )
            time += dt
        if s.heading_scoring:
            cost = s.occdist_scale * worst + s.path_scale * path
            out.cost = cost + 0.3 * heading + goal * s.goal_scale
        else:
            out.cost = s.path_scale * path + goal * s.goal_scale + s.occdist_scale * worst
        return out

    def heading_error(self, at, x, y, yaw):
        for px, py in self.plan[::-1].tolist():
            to = plain.cell(px, py, self.cells, self.frame)
            if to[0] >= 0 and all(self.cells[cell] < 253 for cell in plain.line(at, to)):
                gx = self.frame[0] + (to[1] + 0.5) * self.frame[2]
                gy = self.frame[1] + (to[0] + 0.5) * self.frame[2]
                return abs(between(yaw, math.atan2(gy - y, gx - x)))
        return sys.float_info.max

    def ahead(self, trajectory):
        x, y, yaw = trajectory.points[-1]
        far = self.s.heading_lookahead
        x, y = x + far * math.cos(yaw), y + far * math.sin(yaw)
        row, column = plain.cell(x, y, self.cells, self.frame)
        return None if row < 0 else float(self.goal[row, column])

    def search(self):
        s = self.s
        x, y, yaw, vx, _, wz = self.state.tolist()
        reach = s.period if s.dwa else s.sim_time
        most = min(s.max_vel_x, length(self.plan[-1, 0] - x, self.plan[-1, 1] - y) / s.sim_time)
        most = max(min(most, vx + s.acc_lim_x * reach), s.min_vel_x)
        least = max(s.min_vel_x, vx - s.acc_lim_x * reach)
        left = min(s.max_vel_theta, wz + s.acc_lim_theta * reach)
        right = max(s.min_vel_theta, wz - s.acc_lim_theta * reach)
        step, turn = (most - least) / (s.vx_samples - 1), (left - right) / (s.vtheta_samples - 1)
        best = Trajectory()
        arcs = []
        speed = least
        for _ in range(s.vx_samples):
            arcs.append((speed, 0.0, 0.0))
            w = right
            for _ in range(s.vtheta_samples - 1):
                arcs.append((speed, 0.0, w))
                w += turn
            speed += step
        if s.holonomic_robot:
            arcs += [(0.1, 0.1, 0.0), (0.1, -0.1, 0.0)]
        for arc in [] if self.escaping else arcs:
            found = self.trajectory(arc)
            if found.cost >= 0 and (found.cost < best.cost or best.cost < 0):
                best = found
        nearest = sys.float_info.max
        w = right
        for _ in range(s.vtheta_samples):
            found = self.trajectory(
                (0.0, 0.0, max(w, s.slowest_turn) if w > 0 else min(w, -s.slowest_turn))
            )
            cheap = found.cost <= best.cost or best.cost < 0 or best.velocity[1] != 0.0
            if found.cost >= 0 and cheap and (w > turn or w < -turn):
                ahead = self.ahead(found)
                if ahead is not None and ahead < nearest:
                    stuck = self.stuck["left"] if w < 0 else self.stuck["right"]
                    if w != 0.0 and not stuck:
                        best, nearest = found, ahead
            w += turn
        if best.cost < 0 and s.holonomic_robot:
            for vy in self.strafes:
                found = self.trajectory((0.0, vy, 0.0))
                if found.cost >= 0 and (found.cost <= best.cost or best.cost < 0):
                    ahead = self.ahead(found)
                    if ahead is not None and ahead < nearest:
                        side = "left_strafe" if vy > 0 else "right_strafe"
                        if vy != 0.0 and not self.stuck[side]:
                            best, nearest = found, ahead
        if best.cost >= 0:
            if not best.velocity[0] > 0:
                self.remember(best.velocity)
                self.at = (x, y)
            self.forget(x, y, yaw)
            return best
        best = self.trajectory((s.escape_vel, 0.0, 0.0))
        if not self.escaping and best.cost > -2.0:
            self.escaped_at, self.escaping = (x, y, yaw), True
        self.forget(x, y, yaw)
        return best

    def remember(self, velocity):
        _, vy, wz = velocity
        if wz != 0.0:
            side = "right" if wz < 0 else "left"
            self.stuck[side] = self.stuck[side] or self.flags[f"rotating_{side}"]
            self.flags[f"rotating_{side}"] = True
        elif vy != 0.0:
            side, other = ("right", "left") if vy > 0 else ("left", "right")
            stuck = f"{side}_strafe"
            self.stuck[stuck] = self.stuck[stuck] or self.flags[f"strafe_{side}"]
            self.flags[f"strafe_{other}"] = True

    def forget(self, x, y, yaw):
        if length(x - self.at[0], y - self.at[1]) > self.reset_after:
            self.flags = dict.fromkeys(self.flags, False)
            self.stuck = dict.fromkeys(self.stuck, False)
        ex, ey, eyaw = self.escaped_at
        if length(x - ex, y - ey) > self.escape_after or abs(between(eyaw, yaw)) > self.escape_turn:
            self.escaping = False
