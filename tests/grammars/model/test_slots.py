"""Values whose slots are filled directly are what ``dataclass`` alone would have made of them."""

from __future__ import annotations

import copy
import inspect
import math
import pickle
from dataclasses import FrozenInstanceError, astuple, dataclass, field, make_dataclass, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.model import sut
from grammars.model.geometry import Pose2, Twist2
from grammars.model.slots import fills_slots
from grammars.text import codec

floats = st.floats(allow_nan=False)
Plain = make_dataclass(
    "Pose2", [(name, float, 0.0) for name in ("x", "y", "yaw")], frozen=True, slots=True
)
VALUES = (Pose2, Twist2, sut.Odometry, sut.LaserScan, sut.Observation, sut.Progress, sut.Decision)


@given(floats, floats, floats)
def test_a_pose_is_printed_compared_hashed_pickled_and_read_like_any_value(x, y, yaw):
    pose, plain = Pose2(x, y, yaw=yaw), Plain(x, y, yaw)
    assert repr(pose) == repr(plain)
    assert hash(pose) == hash(plain)
    assert astuple(pose) == astuple(plain)
    assert pose == Pose2(x, y, yaw) == copy.deepcopy(pose)
    assert pose != Pose2(x, y, yaw + 1.0 if abs(yaw) < 1e9 else 0.0)
    assert pickle.loads(pickle.dumps(pose)) == pose
    assert replace(pose, x=1.0) == Pose2(1.0, y, yaw)
    if math.isfinite(x + y + yaw):
        assert codec.from_json(Pose2, codec.to_json(pose)) == pose


def test_defaults_are_those_of_the_fields():
    assert Pose2() == Pose2(0.0, 0.0, 0.0)
    assert Pose2(y=2.0) == Pose2(0.0, 2.0, 0.0)
    scan = sut.LaserScan(1.0, ranges=None)
    assert scan.laser == ""
    decision = sut.Decision(None, sut.Progress(0, 0, "active"))
    assert (decision.plan, decision.events, decision.latency) == (None, (), None)


def test_wrong_arguments_are_told_as_always():
    with pytest.raises(TypeError, match=r"Pose2.__init__\(\) got an unexpected .* 'z'"):
        Pose2(z=1.0)
    with pytest.raises(TypeError, match=r"Odometry.__init__\(\) missing 1 .* 'twist'"):
        sut.Odometry(0.0, Pose2())


@pytest.mark.parametrize("cls", VALUES)
def test_nothing_can_be_assigned_and_the_signature_is_that_of_the_fields(cls):
    value = object.__new__(cls)
    for name in cls.__slots__:
        with pytest.raises(FrozenInstanceError):
            setattr(value, name, 1.0)
        with pytest.raises(FrozenInstanceError):
            delattr(value, name)
    assert not hasattr(value, "__dict__")
    assert tuple(inspect.signature(cls).parameters) == tuple(cls.__slots__)


def test_what_cannot_be_filled_directly_is_refused():
    @dataclass(frozen=True)
    class NoSlots:
        a: int

    @dataclass(frozen=True, slots=True)
    class Made:
        a: list[int] = field(default_factory=list)

    @dataclass(frozen=True, slots=True)
    class Checked:
        a: int

        def __post_init__(self):
            raise ValueError

    @dataclass(frozen=True, slots=True)
    class Longer(sut.Progress):
        more: int = 0

    for cls in (NoSlots, Made, Checked, Longer):
        with pytest.raises(TypeError, match=r"cannot be filled directly"):
            fills_slots(cls)
