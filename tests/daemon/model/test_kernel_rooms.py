"""What is compiled for which system, and that loading alone compiles nothing."""

from importlib import import_module

import pytest

from daemon.model.kernel_rooms import RUN_ROOMS, SYSTEM_ROOMS, kernel_rooms
from daemon.model.kernels import (
    NotCompiledError,
    kernel,
    loading_only,
)

ROS = "daemon.stacks.ros1"


@kernel
def doubled(x):
    return 2.0 * x


@kernel
def quadrupled(x):
    return doubled(doubled(x))


def test_only_what_a_system_calls_is_loaded():
    dwa = {"move_base": {"base_local_planner": "dwa_local_planner/DWAPlannerROS"}}
    assert kernel_rooms("idle", {}) == RUN_ROOMS
    assert kernel_rooms("pilot", {}) == (*RUN_ROOMS, "daemon.stacks.pilot")
    assert {f"{ROS}.dwa", f"{ROS}.navfn"} <= set(kernel_rooms("ros", dwa))
    assert not {f"{ROS}.trajectory_planner", f"{ROS}.global_planner"} & set(
        kernel_rooms("ros", dwa)
    )
    assert f"{ROS}.trajectory_planner" in kernel_rooms("ros", {"move_base": None})


@pytest.mark.parametrize("room", [*RUN_ROOMS, *SYSTEM_ROOMS])
def test_every_room_can_be_warmed_up(room):
    assert callable(import_module(room).warm_up)


def test_loading_only_refuses_to_compile_and_leaves_the_kernel_usable():
    # As on a machine that has never compiled them.
    quadrupled._cache.load_overload = lambda *_: None
    doubled._cache.load_overload = lambda *_: None
    with loading_only(), pytest.raises(NotCompiledError, match="quadrupled"):
        quadrupled(1.0)
    assert quadrupled(1.0) == 4.0
