"""The search predicts the cells where samples end, and knows of which of them it is unsure."""

from dataclasses import replace

import numpy as np
import pytest

from tests.stacks.ros1.dwa import plain
from tests.stacks.ros1.dwa.helpers import A2S, OMNI, random_problem, singles
from tests.stacks.ros1.dwa.test_same_winner import FEW_DIFF, far_away


def problems(rng, parameters, number):
    return [random_problem(rng, parameters) for _ in range(number)]


def assert_ends_hold(problem):
    """Compare where samples end with where they were said to; return how many were unsure, sure."""
    unsure, known = 0, 0
    _, room = problem.search()
    local = problem.local
    frame = np.array((local.x, local.y, local.resolution))
    for sample, (centre, nose) in zip(problem.samples(), room.ends.tolist(), strict=False):
        points, _ = plain.trajectory(problem.state, sample, problem.settings)
        if centre == -3:
            assert len(points) == 0 or plain.oscillates(problem.banned, sample)
            continue
        x, y, yaw = points[-1].tolist()
        ahead = problem.settings.forward_point_distance
        spots = ((x, y), (x + ahead * np.cos(yaw), y + ahead * np.sin(yaw)))
        for end, spot in zip((centre, nose), spots, strict=True):
            row, column = plain.cell(*spot, local.cells, frame)
            unsure += end == -2
            known += end != -2
            place = row * local.cells.shape[1] + column if row >= 0 else -1
            assert end in (place, -2)
    return unsure, known


@pytest.mark.parametrize("parameters", [A2S, OMNI])
def test_ends_are_sure_or_said_to_be_unsure(parameters):
    rng = np.random.default_rng(11)
    counts = [assert_ends_hold(problem) for problem in problems(rng, parameters, 6)]
    unsure, known = np.sum(counts, axis=0)
    # Coordinates of 80 m have steps of 8e-6 m in single precision, cells are 0.05 m wide.
    assert unsure < 0.05 * known


@pytest.mark.parametrize(
    ("parameters", "turning"),
    [
        # Nearly all points of these trajectories come from turning, and from driving.
        (replace(FEW_DIFF, sim_granularity=1.0, sim_time=16.0, vth_samples=20), 1.0),
        (replace(FEW_DIFF, sim_granularity=0.003, sim_time=5.0, acc_lim_theta=0.5), 0.05),
    ],
)
def test_the_more_steps_are_rounded_the_less_sure_ends_are(parameters, turning):
    rng = np.random.default_rng(12)
    for problem in problems(rng, parameters, 12):
        for vx, wz in ((0.2, turning), (-0.2, -turning)):
            problem.state[3:] = singles(vx, 0.0, wz)
            problem.local.cells[:] = 0
            assert_ends_hold(far_away(problem, rng))
