"""A live world: by the clock, obeying, without any promise but that nobody waits."""

import math
from dataclasses import replace

import numpy as np
import pytest
from mcap.reader import make_reader

from daemon.live.simulation import LiveSimulation
from daemon.model import ros_messages as ros
from daemon.model.spec import SutReference
from daemon.model.sut import Decision, Progress
from daemon.run import SceneMismatchError, execute
from daemon.stacks.registry import make_sut
from daemon.trace.messages import KINDS
from grammars.model.geometry import Twist2
from tests.batch.live.worlds import HandClock, Kept, demo_spec, demo_submission, go


@pytest.fixture(scope="module")
def demo(campaigns):
    return demo_submission(campaigns)


def world(demo, system="idle", **options):
    clock, kept = HandClock(), Kept()
    spec, scene = demo_spec(demo)
    spec = replace(spec, sut=SutReference(system, system, {}))
    simulation = LiveSimulation(spec, scene, clock=clock, **options)
    simulation.add_outlet(kept)
    simulation.step()
    return simulation, clock, kept


def poses(kept):
    found = []
    for _, payload in kept.of("/ground_truth"):
        at = ros.deserialize(payload, KINDS["/ground_truth"]).pose.pose.position
        found.append((at.x, at.y))
    return found


def test_a_world_nobody_commands_is_that_of_an_idle_run(demo, tmp_path):
    simulation, clock, kept = world(demo)
    # Unevenly, and with a pause: how the clock goes must not show.
    for seconds in (0.013, 0.4, 0.07, 1.0):
        go(simulation, clock, seconds, seconds)
    simulation.pause(True)
    go(simulation, clock, 5.0)
    simulation.pause(False)
    while simulation.status.time < 6.0:
        go(simulation, clock, 0.03, 0.03)
    spec, scene = demo_spec(demo)
    execute(replace(spec, limit=6.0), scene, trace_path=tmp_path / "run.mcap")
    with (tmp_path / "run.mcap").open("rb") as file:
        recorded = {}
        for _, channel, message in make_reader(file).iter_messages():
            recorded.setdefault(channel.topic, []).append((message.log_time, message.data))
    assert len(recorded["/scan"]) > 50
    for topic in ("/scan", "/odom", "/ground_truth", "/clock", "/tf_static", "/map", "/scene",
                  "/events"):  # fmt: skip
        live = [one for one in kept.of(topic) if one[0] <= 6_000_000_000]
        assert live == recorded.get(topic, []), topic
    # The trace leaves repeated joint states out; all it keeps was said.
    assert set(recorded["/joint_states"]) <= set(kept.of("/joint_states"))
    frames = [one for one in kept.of("/tf") if one[0] <= 6_000_000_000]
    assert set(frames) >= {one for one in recorded["/tf"] if one[0] % 100_000_000 == 0}


def test_it_keeps_to_the_clock_and_to_its_speed(demo):
    simulation, clock, kept = world(demo)
    go(simulation, clock, 2.0)
    assert simulation.status.time == pytest.approx(2.0, abs=0.011)
    simulation.set_speed(4.0)
    go(simulation, clock, 1.0)
    # Asked for at the first of these steps, so that one went at the speed before.
    assert simulation.status.time == pytest.approx(2.0 + 3.8, abs=0.05)
    assert not simulation.status.late
    simulation.pause(True)
    go(simulation, clock, 0.1)
    stood = simulation.status.time
    go(simulation, clock, 3.0)
    assert simulation.status.paused
    assert simulation.status.time == stood
    simulation.toggle()
    go(simulation, clock, 0.5)
    assert simulation.status.time == pytest.approx(stood + 4.0 * 0.45, abs=0.05)
    assert kept.last == simulation.status


def test_time_that_cannot_be_made_up_is_given_up_and_that_is_told(demo):
    simulation, clock, _ = world(demo)
    clock.now += 1000.0

    def passing():
        clock.now += 0.01  # computing takes time
        return clock.now

    simulation._clock = passing
    simulation.step()
    assert simulation.status.time < 10.0
    simulation.step()
    assert simulation.status.late
    simulation._clock = clock
    go(simulation, clock, 3.0)
    assert not simulation.status.late
    assert simulation.status.reached == pytest.approx(1.0, abs=0.1)


def test_a_command_moves_the_robot_until_the_drive_times_out(demo):
    simulation, clock, kept = world(demo)
    timeout = simulation.spec.robot.drive.timeout
    assert timeout > 0.0
    go(simulation, clock, 1.0)
    assert len(set(poses(kept))) == 1, "it stands as long as nobody commands it"
    simulation.command(Twist2(0.1, 0.0, 0.0), "somebody else")
    simulation.command(Twist2(0.0, 0.0, 0.5), "a test")
    go(simulation, clock, 0.2)
    assert simulation.status.driver == "a test"
    go(simulation, clock, timeout + 3.0)
    assert simulation.status.driver == ""
    ((stamp, said),) = kept.of("/cmd_vel")
    assert ros.deserialize(said, KINDS["/cmd_vel"]).twist.angular.z == 0.5
    twists = [
        ros.deserialize(payload, KINDS["/ground_truth"]).twist.twist.angular.z
        for _, payload in kept.of("/ground_truth")
    ]
    assert max(twists) > 0.3
    assert twists[-1] == pytest.approx(0.0, abs=1e-3)
    assert stamp >= 1_000_000_000


def test_what_is_commanded_while_it_stands_is_forgotten(demo):
    simulation, clock, kept = world(demo)
    simulation.pause(True)
    simulation.command(Twist2(0.2, 0.0, 0.0), "a test")
    go(simulation, clock, 0.2)
    simulation.pause(False)
    go(simulation, clock, 0.5)
    assert not kept.of("/cmd_vel")
    with pytest.raises(ValueError, match="finite"):
        simulation.command(Twist2(math.nan, 0.0, 0.0), "a test")


def test_after_a_reset_it_is_the_same_world(demo):
    simulation, clock, kept = world(demo)
    simulation.command(Twist2(0.2, 0.0, 0.0), "a test")
    go(simulation, clock, 2.0)
    kept.messages.clear()
    simulation.reset()
    simulation.step()
    go(simulation, clock, 1.0)
    first = [one for one in kept.messages if one[1] <= 900_000_000]
    assert kept.begun == 1
    assert simulation.status.worlds == 2
    kept.messages.clear()
    simulation.reset()
    go(simulation, clock, 1.0)
    assert [one for one in kept.messages if one[1] <= 900_000_000] == first
    assert first[0][0] == "/map"


def test_a_system_inside_drives_and_a_command_holds_it(demo):
    pilot = {"sut": lambda: make_sut("pilot", {}), "speed": 10.0}
    simulation, clock, kept = world(demo, "pilot", **pilot)
    simulation.watched = True
    go(simulation, clock, 0.5)
    assert simulation.status.driver == "pilot"
    assert kept.of("/plan")
    assert kept.of("/pose")
    assert simulation.view is not None
    assert simulation.view.plan
    assert simulation.view.returns
    said = len(kept.of("/cmd_vel"))
    simulation.command(Twist2(), "a test")
    go(simulation, clock, 0.09, 0.01)
    assert len(kept.of("/cmd_vel")) == said + 1
    go(simulation, clock, 0.5)
    assert simulation.status.driver == "pilot"
    assert len(kept.of("/cmd_vel")) > said + 2


class Crashing:
    period, needs_ground_truth = 0.05, True

    def start(self, briefing):
        pass

    def update(self, observation):
        assert observation.ground_truth is not None
        if observation.time > 0.5:
            raise RuntimeError("no more")
        return Decision(Twist2(0.1, 0.0, 0.0), Progress(0, 0, "active"))


def test_a_system_that_crashes_is_told_of_and_the_world_goes_on(demo):
    simulation, clock, kept = world(demo, sut=Crashing)
    go(simulation, clock, 2.0)
    assert "RuntimeError: no more" in simulation.status.note
    assert simulation.status.time > 1.5
    log = [ros.deserialize(payload, KINDS["/events"]) for _, payload in kept.of("/events")]
    assert any("no more" in one.msg and one.level == 40 for one in log)
    simulation.command(Twist2(0.0, 0.0, 0.3), "a test")
    go(simulation, clock, 0.3)
    assert simulation.status.driver == "a test"


def test_what_it_refuses(demo):
    spec, scene = demo_spec(demo)
    with pytest.raises(SceneMismatchError):
        LiveSimulation(replace(spec, scene="0" * 64), scene)
    for speed in (0.0, -1.0, 1e6, math.nan):
        with pytest.raises(ValueError, match="speed"):
            LiveSimulation(spec, scene, speed=speed)
    assert np.isfinite(LiveSimulation(spec, scene).status.limit)
