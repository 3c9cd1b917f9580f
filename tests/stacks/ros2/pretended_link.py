"""A stack as its link and its processes show it, without anything behind them."""

import numpy as np

from daemon.model import ros_messages as ros
from daemon.model.sut import Briefing, LaserScan, Observation, Odometry
from daemon.stacks.ros2 import bring_up, inspection, sensors, stack
from daemon.stacks.ros2.causes import ALARMS
from daemon.stacks.ros2.link import (
    CycleAnswer,
    Graph,
    LinkLost,
    Readiness,
    ReceivedMessage,
    StackIdentity,
)
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from grammars.model.mission import Mission, Waypoint
from tests.engine.trace.recordings import ROBOT

NODES = ("/amcl", "/bt_navigator")
START = Pose2(1.0, 2.0)
BRIEFING = Briefing(
    ROBOT,
    OccupancyGrid(0.5, 0.0, 0.0, np.zeros((8, 8), np.int8)),
    Mission("check", START, (Waypoint("here", 0.0, 0.0),)),
    START,
    np.random.SeedSequence(0),
)


def observation(time=0.0, *, scans=()):
    return Observation(time, (Odometry(time, Pose2(), Twist2()),), scans)


FIRST = observation(scans=(LaserScan(0.0, np.full(ROBOT.laser.rays, 2.0, np.float32)),))


class PretendedLink:
    """Ready at once, unless told otherwise; remembers goals; answers cycles with ``answer``.

    ``believes``: where it says to be once it was told its pose, with ``once`` only in the answer
    to that. ``gone``: the link is lost.
    """

    def __init__(self, believes=START, *, once=False):
        self.identity = StackIdentity("jazzy", "rmw_pretended")
        self.goals, self.cycles, self.told, self.asked = [], [], [], []
        self.answer = CycleAnswer(None, 0, heard=False, server=True)
        self.believes, self.once = believes, once
        self.states = dict.fromkeys(NODES, "active")
        self.endpoints = ()
        self.gone = self.closed = False

    def accept(self, timeout=0.1):
        return True

    def set_up(self, setup):
        self.setup = setup

    def cycle(self, cycle):
        if self.gone:
            raise LinkLost("the relay is silent")
        self.cycles.append(cycle)
        told = [data for topic, data in cycle.messages if topic == "/initialpose"]
        self.told += told
        if not self.told or self.believes is None or (self.once and not told):
            return self.answer
        pose = self.believes
        qz, qw = ros.yaw_quaternion(pose.yaw)
        correction = ros.transform(ros.time(0), "map", "odom", x=pose.x, y=pose.y, qz=qz, qw=qw)
        message = ros.make(sensors.TRANSFORMS, transforms=[correction])
        data = ros.serialize(message, sensors.TRANSFORMS)
        heard = (ReceivedMessage("/tf", sensors.TRANSFORMS, data),)
        return CycleAnswer(None, 0, heard=True, server=True, messages=heard)

    def readiness(self):
        return Readiness(dict(self.states), True, {"/initialpose": 1, "/scan": 1})

    def send_goal(self, goal, poses, frame, time):
        self.goals.append((goal, poses, frame, time))

    def graph(self):
        return Graph(self.endpoints, NODES, ("/amcl/get_parameters", "/amcl/get_state", "/talk"))

    def parameters(self, node, names):
        self.asked.append((node, names))
        return dict.fromkeys(names, True)

    def close(self):
        self.closed = True


class PretendedProcess:
    """Stands in for the processes of a stack; remembers how often they were released."""

    def __init__(self, folder):
        self.folder = folder
        self.socket, self.nonce, self.domain = folder / "socket", "", 7
        self.end = self.dead = ""
        self.printed = ["its last line"]
        self.released = 0

    def start(self):
        assert (self.folder / "map.yaml").exists()

    def ended(self):
        return self.end

    def alarms(self):
        return [line for line in self.printed if any(alarm in line for alarm in ALARMS)]

    def watch_nodes(self, nodes):
        self.watched = nodes

    def dead_process(self):
        return self.dead

    def lines(self):
        return self.printed

    def outputs(self):
        return {}

    def release(self):
        self.released += 1


class HurriedClock:
    """A wall clock that nobody waits for: sleeping turns it, and so does each look at it."""

    _now = 0.0

    def monotonic(self):
        self.sleep(0.001)
        return self._now

    def sleep(self, seconds):
        self._now += seconds


class Machine:
    """What is found, or started, when a run asks for its stack: one after the other."""

    def __init__(self, folder, monkeypatch):
        self._folder, self._stacks, self._next = folder, [], 0
        self.clock = HurriedClock()
        for module in (bring_up, inspection, stack):
            monkeypatch.setattr(module, "wall_clock", self.clock)
        monkeypatch.setattr(bring_up, "StackProcess", self._process)
        monkeypatch.setattr(bring_up.RelayLink, "listen", self._listen)

    def will_have(self, link=None):
        """Return the link of the next stack, and its processes."""
        place = self._folder / f"stack-{len(self._stacks)}"
        place.mkdir()
        self._stacks.append((link or PretendedLink(), PretendedProcess(place)))
        return self._stacks[-1]

    def _process(self, *_, **__):
        return self._stacks[self._next][1]

    def _listen(self, *_):
        self._next += 1
        return self._stacks[self._next - 1][0]
