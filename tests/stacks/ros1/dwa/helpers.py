"""Configurations of the paper, random problems and a way to ask both versions."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import yaml

from daemon.stacks.findings import FindingCollector
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.base_local_planner.map_grid import passable_cells
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.dwa import DwaParameters
from daemon.stacks.ros1.dwa._scoring import (
    allocate_scoring_grid,
    critic_weights,
    fill_distances,
)
from daemon.stacks.ros1.dwa._search import allocate_buffers, find_best_sample
from daemon.stacks.ros1.dwa.samples import (
    DwaSettings,
    longest_trajectory,
    sample_speeds,
    settings_of,
)
from daemon.stacks.ros1.parameters import ParameterNamespace, read_section
from daemon.stacks.ros1.quirks import FAST
from grammars.model.geometry import Floats
from tests.stacks.ros1.dwa import plain

FILE = Path(__file__).parents[4] / "campaigns/suts/fro-diff/dwa_local_planner_params.yaml"
A2S = read_section(
    DwaParameters,
    ParameterNamespace.of(yaml.safe_load(FILE.read_text("utf-8")), ()).below("DWAPlannerROS"),
    FindingCollector(),
)
OMNI = replace(
    A2S, min_vel_x=0.11, max_vel_y=0.11, min_vel_y=-0.11, acc_lim_y=1.25, xy_goal_tolerance=0.15,
    yaw_goal_tolerance=6.28, sim_time=2.5, vx_samples=5, vy_samples=10, vth_samples=20,
    controller_frequency=20.0,
)  # fmt: skip
SMALL = np.array([[0.115, 0.085], [-0.09, 0.085], [-0.09, -0.085], [0.115, -0.085]])
LARGE = np.array([[0.36, 0.243], [-0.36, 0.243], [-0.36, -0.243], [0.36, -0.243]])


def singles(*values):
    """Return values as the original stores them."""
    return np.array(values, dtype=np.float32).astype(np.float64)


def settings(parameters=A2S, quirks=FAST):
    return settings_of(parameters, quirks, 0.05, 0.05)


@dataclass
class Problem:
    """One sampling cycle: everything the decision depends on."""

    state: Floats
    plan: Floats
    front_end: Floats
    aligned: bool
    settings: DwaSettings
    local: CostGrid
    outline: Floats
    banned: Integers

    def search(self):
        """Return the number of points of the winner, 0 for none, and what the search wrote."""
        cycle, room = self.cycle()
        return cycle(), room

    def cycle(self):
        """Return a whole search to call, and where it writes."""
        s, shape = self.settings, self.local.cells.shape
        field = allocate_scoring_grid(self.local, s, self.outline, self.banned)
        room = allocate_buffers(shape, s, longest_trajectory(s, *self.state[3:].tolist()))
        passable_cells(self.local.cells, field.passable)
        state, plan = self.state, self.plan
        weights = critic_weights(s, self.aligned)

        def search():
            near = sample_speeds(state, plan[-1], s, room.samples, room.counts)
            reach = (near, near + abs(s.forward_point_distance))
            fill_distances(state, plan, self.front_end, reach, weights, field)
            return find_best_sample(state, weights, s, field, room)

        return search, room

    def fast(self):
        """Return place, cost, velocity and trajectory of the winner; place -1 for none."""
        n, room = self.search()
        if n == 0:
            return -1, -1.0, np.zeros(3), np.empty((0, 3))
        answer = room.answer
        return int(answer[4]), float(answer[3]), answer[:3].copy(), room.points[:n, :3].copy()

    def costs(self):
        """Return the cost of every sample by the plain version, infinite where it is illegal."""
        local = self.local
        frame = np.array((local.x, local.y, local.resolution))
        plan = self.state, self.plan, self.front_end, self.aligned, self.settings
        return plain.costs(*plan, local.cells, frame, self.outline, self.banned)

    def samples(self):
        """Return every sample, shape (samples, 3), by the plain version."""
        distance = math.hypot(*(self.plan[-1] - self.state[:2]).tolist())
        return plain.raw_samples(self.state, distance, self.settings)

    def plain(self):
        """Return place, cost and velocity of the winner; place -1 for none."""
        costs = self.costs()
        place = int(np.argmin(costs))
        if costs[place] == np.inf:
            return -1, -1.0, np.zeros(3)
        velocity = plain.trajectory(self.state, self.samples()[place], self.settings)[1]
        return place, float(costs[place]), velocity


def blobs(rng, shape, number, unknown):
    """Return inflated costs around ``number`` lethal cells, and some unknown ones."""
    rows, columns = np.indices(shape)
    cost = np.zeros(shape)
    for _ in range(number):
        row, column = rng.integers(shape[0]), rng.integers(shape[1])
        d = 0.05 * np.hypot(rows - row, columns - column)
        near = np.where(d <= 0.085, 253, 252 * np.exp(-5.0 * (d - 0.085)))
        cost = np.maximum(cost, np.where(d == 0, 254, np.where(d < 0.55, near, 0)))
    cost[rng.random(shape) < unknown] = 255
    return cost.astype(np.uint8)


def random_problem(rng, parameters, quirks=FAST):
    """Return a cycle somewhere on a winding plan among obstacles."""
    shape = (60, 60) if rng.random() < 0.7 else (40, 90)
    x, y, yaw = rng.uniform(-80, 80), rng.uniform(-80, 80), rng.uniform(-math.pi, math.pi)
    offset = rng.uniform(-0.3, 0.3, 2)
    local = CostGrid(
        0.05,
        x - shape[1] * 0.025 + offset[0],
        y - shape[0] * 0.025 + offset[1],
        blobs(rng, shape, int(rng.integers(0, 8)), 0.02 if rng.random() < 0.2 else 0.0),
    )
    heading = yaw + rng.normal(0.0, 0.7) + np.cumsum(rng.normal(0.0, 0.06, 70))
    step = 0.025 if rng.random() < 0.8 else 0.09
    plan = np.cumsum(step * np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)
    plan = plan[: int(rng.integers(1, 70))] + np.array((x, y)) + rng.normal(0.0, 0.05, 2)
    v = rng.uniform(-0.05, 0.23)
    sideways = rng.choice([0.0, rng.normal(0.0, 0.01)])
    state = singles(x, y, yaw, v, sideways, rng.normal(0.0, 0.8))
    banned = (rng.random(6) < 0.1).astype(np.int32)
    outline = SMALL if rng.random() < 0.6 else LARGE
    front_end = plan[-1] + 0.325 * np.array((math.cos(yaw), math.sin(yaw)))
    built = settings(parameters, quirks)
    aligned = bool(rng.random() < 0.8) and built.path_scale != 0.0
    return Problem(state, plan, front_end, aligned, built, local, outline, banned)
