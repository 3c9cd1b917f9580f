"""A live world and a genuine ROS 2 stack that somebody started by hand, over the relay."""

import os
import subprocess
import threading
from contextlib import contextmanager
from pathlib import Path

import pytest

from daemon.live.ros_bridge import RosBridge
from daemon.live.simulation import LiveSimulation
from daemon.stacks.ros2.link import RelayLink, relay_path
from tests.batch.live.worlds import DEADLINE, Kept, demo_spec, demo_submission

STACK = Path(__file__).with_name("small_stack.py")


class Watched(Kept):
    """An outlet that knows how far the robot has come, and can be waited for."""

    def __init__(self, simulation):
        super().__init__()
        self._simulation = simulation
        self.moved = False
        self.drivers = set()

    def status(self, status):
        self.drivers.add(status.driver)
        view, start = self._simulation.view, self._simulation.spec.mission.start
        self.moved |= view is not None and abs(view.pose.x - start.x) > 0.02


@contextmanager
def started(python, program, variables, *words):  # fmt: skip
    log = Path(variables["HOME"]) / f"{program.stem}.txt"
    with log.open("wb") as said:
        child = subprocess.Popen(
            [python, program, *words], env=variables, stdin=subprocess.PIPE,
            stdout=said, stderr=said,
        )  # fmt: skip
        try:
            yield child
        finally:
            child.kill()
            child.communicate()


def until(condition, simulation):
    """Let the world go on until ``condition`` holds; its own time is the deadline."""
    pause = threading.Event()
    last = simulation.status.time + DEADLINE
    while not condition():
        assert simulation.status.time < last, "it never came"
        pause.wait(0.05)


@pytest.mark.one_distribution
def test_a_stack_started_by_hand_drives(ros2_python, ros2_variables, tmp_path, campaigns):
    simulation = LiveSimulation(*demo_spec(demo_submission(campaigns)))
    simulation.watched = True
    watched = Watched(simulation)
    simulation.add_outlet(watched)
    socket = tmp_path / "relay"
    bridge = RosBridge(simulation, lambda: RelayLink.listen(socket, "nonce"))
    relay = ros2_variables | {"SCENARIO_SOCKET": str(socket), "SCENARIO_NONCE": "nonce"}
    try:
        with simulation.running(), started(ros2_python, STACK, ros2_variables, "unstamped"):
            with started(ros2_python, relay_path(), relay):
                until(lambda: bridge.connected and watched.moved, simulation)
                assert "ROS 2" in watched.drivers
            # The relay is gone: the world goes on, and the next one finds it.
            until(lambda: not bridge.connected, simulation)
            with started(ros2_python, relay_path(), relay):
                until(lambda: bridge.connected, simulation)
        assert bridge.failure is None
    finally:
        bridge.close()
    assert not os.path.lexists(socket)
