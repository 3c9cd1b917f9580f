"""Resets that clear nothing, resets that work, and the turn on the spot."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.ros1.cost_grid import LETHAL, CostGrid
from daemon.stacks.ros1.move_base import (
    CLEAR,
    ROTATE,
    ClearCostmapParameters,
    MoveBaseParameters,
    RotateRecoveryParameters,
)
from daemon.stacks.ros1.move_base._parameters import RecoveryBehavior
from daemon.stacks.ros1.move_base.recoveries import make_recoveries, turn_is_free
from daemon.stacks.ros1.quirks import FAST, FIXED
from grammars.model.geometry import Pose2, Twist2
from tests.stacks.ros1.costmap.plain import line

RING = np.array([(-0.36, -0.24), (0.36, -0.24), (0.36, 0.24), (-0.36, 0.24)])


def empty():
    return CostGrid(0.05, -1.5, -1.5, np.zeros((60, 60), np.uint8))


class FakeCostmap:
    """An observed costmap with one layer that lasers fill, called obstacle_layer."""

    def __init__(self, name, base, grid, cleared):
        self.name, self.cleared = name, cleared
        self.costmap = SimpleNamespace(grid=grid, clear_layers=self.clear)
        self.frame = SimpleNamespace(base=base)

    def clear(self, base, side, names, *, inside):
        assert base == self.frame.base
        if names is not None and "obstacle_layer" not in names:
            return ()
        self.cleared.append((f"inside {self.name}" if inside else self.name, side))
        return ("obstacle_layer",)

    def update(self):
        self.cleared.append((f"{self.name} updated", 0.0))


def make(quirks=FAST, grid=None, resets=None, **parameters):
    """Recoveries, what they clear, and the local costmap the robot stands on."""
    cleared = []
    wide = FakeCostmap("global", Pose2(3.0, 4.0), None, cleared)
    near = FakeCostmap("local", Pose2(), grid or empty(), cleared)
    recoveries = make_recoveries(
        MoveBaseParameters(**parameters), RotateRecoveryParameters(), resets or {}, quirks, RING,
        wide, near,
    )  # fmt: skip
    return recoveries, cleared, near


def test_the_default_behaviours_are_those_of_move_base():
    names = [r.name for r in make()[0]]
    turn = "rotate_recovery"
    assert names == ["conservative_reset", turn, "aggressive_reset", turn]
    names = [r.name for r in make(clearing_rotation_allowed=False)[0]]
    assert names == ["conservative_reset", "aggressive_reset"]
    assert make(recovery_behavior_enabled=False)[0] == ()


def test_working_resets_keep_the_square_that_move_base_gives_them():
    recoveries, cleared, _ = make(FIXED, resets={"conservative_reset": ClearCostmapParameters(9.0)})
    recoveries[0].step()
    recoveries[2].step()
    sides = [("global", 3.0), ("local", 3.0), ("global", 1.84), ("local", 1.84)]
    assert cleared == [(name, pytest.approx(side)) for name, side in sides]


@pytest.mark.parametrize(
    ("reset", "log", "expected"),
    [
        # The original names a layer that nobody has.
        ({}, "mine finds no layer to clear", []),
        ({"layer_names": ("obstacle_layer",), "affected_maps": "local"},
         "mine cleared the local costmap outside a square of 2.00 m", [("local", 2.0)]),
        ({"layer_names": ("obstacle_layer",), "invert_area_to_clear": True,
          "force_updating": True},
         "mine cleared the global and local costmap inside a square of 2.00 m",
         [("inside global", 2.0), ("global updated", 0.0), ("inside local", 2.0),
          ("local updated", 0.0)]),
    ],
)  # fmt: skip
def test_a_reset_clears_the_layers_it_names(reset, log, expected):
    own, resets = RecoveryBehavior("mine", CLEAR), {"mine": ClearCostmapParameters(2.0, **reset)}
    ((recovery,), cleared, _) = make(resets=resets, recovery_behaviors=(own,))
    advance = recovery.step()
    assert (advance.ended, advance.log, cleared) == (True, log, expected)


def test_the_turn_goes_once_round_to_the_left_and_slows_down_at_its_end():
    (turn,), _, near = make(recovery_behaviors=(RecoveryBehavior("turn", ROTATE),))
    yaw, speeds = 1.0, []
    near.frame.base = Pose2(0.0, 0.0, yaw)
    turn.start()
    for _ in range(400):
        near.frame.base = Pose2(0.0, 0.0, math.remainder(yaw, math.tau))
        advance = turn.step()
        if advance.ended:
            break
        speeds.append(advance.command.wz)
        yaw += speeds[-1] * turn.period
    assert "turned once" in advance.log
    assert advance.command is None, "nothing stops the robot"
    assert yaw - 1.0 == pytest.approx(math.tau, abs=0.15)
    assert max(speeds) == 1.0
    assert min(speeds) == pytest.approx(math.sqrt(2.0 * 3.2 * 0.1), abs=0.1)


@pytest.mark.parametrize(("quirks", "command"), [(FAST, None), (FIXED, Twist2())])
def test_the_turn_is_refused_where_it_would_collide(quirks, command):
    grid = empty()
    grid.cells[30 + 8, 30] = LETHAL  # 0.40 m to the left: beside the flank, within the corners
    ((turn,), *_) = make(quirks, grid, recovery_behaviors=(RecoveryBehavior("turn", ROTATE),))
    turn.start()
    advance = turn.step()
    assert (advance.ended, advance.command) == (True, command), "only the quirk stops nothing"
    assert "cannot turn" in advance.log


def plain_turn_is_free(grid, ring, pose, angle, by):
    turned = 0.0
    while turned < angle:
        corners = Pose2(pose.x, pose.y, pose.yaw + turned).apply_ring(ring.tolist())
        cells = [grid.cell(x, y) for x, y in corners]
        if any(cell is None for cell in cells):
            return False
        for a, b in zip(cells, cells[1:] + cells[:1], strict=True):
            if any(grid.cells[y, x] >= LETHAL for x, y in line(*a, *b)):
                return False
        turned += by
    return True


@given(
    st.lists(st.tuples(st.integers(0, 59), st.integers(0, 59)), max_size=12),
    st.floats(-1.4, 1.4),
    st.floats(-1.4, 1.4),
    st.floats(-3.0, 3.0),
    st.floats(0.0, 6.3),
)
def test_the_kernel_sees_the_same_collisions_as_the_plain_version(lethal, x, y, yaw, angle):
    grid = empty()
    for column, row in lethal:
        grid.cells[row, column] = LETHAL
    pose = Pose2(x, y, yaw)
    free = turn_is_free(grid, RING, pose, angle, 0.1)
    assert free == plain_turn_is_free(grid, RING, pose, angle, 0.1)
