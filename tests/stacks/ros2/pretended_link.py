"""A link and processes without anything behind them, for tests of what stands on links."""

from daemon.stacks.ros2.causes import ALARMS
from daemon.stacks.ros2.link import (
    CycleAnswer,
    Graph,
    Readiness,
    StackIdentity,
)


class PretendedLink:
    """Remembers goals; answers cycles with ``answer``."""

    def __init__(self):
        self.identity = StackIdentity("", "rmw_pretended")
        self.goals = []
        self.cycles = []
        self.answer = CycleAnswer(None, 0, heard=False, server=True)

    def set_up(self, setup):
        self.setup = setup

    def cycle(self, cycle):
        self.cycles.append(cycle)
        return self.answer

    def readiness(self):
        return Readiness({}, True, {})

    def send_goal(self, goal, poses, frame, time):
        self.goals.append((goal, poses, frame, time))

    def graph(self):
        return Graph((), (), ())

    def parameters(self, node, names):
        return dict.fromkeys(names, True)

    def close(self):
        self.cycles.clear()


class PretendedProcess:
    """Stands in for the processes of a stack; remembers how they were released."""

    def __init__(self, folder):
        self.folder = folder
        self.socket, self.nonce, self.domain = folder / "socket", "", 7
        self.end = self.dead = ""
        self.printed = ["its last line"]
        self.released = 0

    def __call__(self, settings, **_):
        self.settings = settings
        return self

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
