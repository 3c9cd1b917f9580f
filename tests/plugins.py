"""A package of somebody's with systems under test of all sorts, installed for one test."""

import functools
import os
import re
import sys
from types import SimpleNamespace

from daemon.model import deadline
from daemon.stacks import registry

MODULE = "stacks_of_others"

SOURCE = """
import ctypes
import random
import signal
import sys
import time
from types import SimpleNamespace

import numpy as np

from daemon.model import deadline
from scenario_tui.sut import Decision, Progress, Twist2


class Plain:
    period = 0.1
    needs_ground_truth = False

    def __init__(self, parameters):
        self.parameters = dict(parameters)

    def start(self, briefing):
        self.briefing = briefing
        self.count = len(briefing.mission.waypoints)

    def update(self, observation):
        return Decision(None, Progress(0, 0, "active"))


class SaysDone(Plain):
    def update(self, observation):
        return Decision(Twist2(), Progress(self.count, self.count, "succeeded"))


class GivesUp(Plain):
    def update(self, observation):
        return Decision(Twist2(), Progress(0, 0, "aborted"))


class Leaves(Plain):
    def update(self, observation):
        sys.exit(3)


class Hangs(Plain):
    def update(self, observation):
        while observation.time >= 1.0:
            pass  # here it hangs
        return Decision(Twist2(0.2), Progress(0, 0, "active"))


class HangsForHours(Hangs):
    def update(self, observation):
        if observation.time >= 1.0:
            # All limits are over: their clock says so, and the alarm comes.
            deadline.time = SimpleNamespace(monotonic=lambda: 1e9)
            signal.setitimer(signal.ITIMER_REAL, 0.001)
        return super().update(observation)


class Crashes(Plain):
    def update(self, observation):
        ctypes.string_at(0)


class Random(Plain):
    draw = staticmethod(random.random)

    def update(self, observation):
        over = observation.time >= 2.0
        turn = self.draw() if observation.time >= 1.0 else 0.5
        return Decision(Twist2(0.1, 0.0, turn), Progress(0, 0, "aborted" if over else "active"))


class NumpyRandom(Random):
    draw = staticmethod(np.random.random)


class Seeded(Random):
    def start(self, briefing):
        super().start(briefing)
        self.draw = np.random.default_rng(briefing.seed).random


def hangs(parameters):
    while True:
        pass  # its factory hangs


def hangs_in_a_run(parameters):
    if "hang" in parameters:
        time.sleep(1e6)
    return Plain(parameters)


def leaves(parameters):
    sys.exit(2)


def prints(parameters):
    print("loading weights")
    return Plain(parameters)


def has_no_words(parameters):
    raise ValueError


def refuses(parameters):
    raise ValueError('"speed" must be positive')


def reads_with_a_library(parameters):
    from pydantic import TypeAdapter

    TypeAdapter(dict[str, float]).validate_python({"speed": "fast"})
"""


def _kinds():
    """Kinds of systems and their names: ``says-done`` is SaysDone, ``factory-hangs`` is hangs."""
    for name in re.findall(r"^(?:class|def) (\w+)", SOURCE, re.MULTILINE):
        words = re.sub(r"(?<!^)(?=[A-Z])|_", "-", name).lower()
        yield words if name[0].isupper() else f"factory-{words}", name


def install_plugins(folder, monkeypatch):
    """Install the package into ``folder`` and let this process and its children find it."""
    (folder / f"{MODULE}.py").write_text(SOURCE)
    (folder / "slow_to_import.py").write_text("import time\ntime.sleep(1e6)\n")
    info = folder / "stacks_of_others-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: stacks-of-others\nVersion: 1.0\n")
    lines = [f"{kind} = {MODULE}:{name}" for kind, name in _kinds()]
    lines.append("import-hangs = slow_to_import:make")
    (info / "entry_points.txt").write_text("\n".join(["[scenario.suts]", *lines, ""]))
    monkeypatch.syspath_prepend(str(folder))
    paths = [str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(paths))
    monkeypatch.delitem(sys.modules, MODULE, raising=False)
    # A process looks plug-ins up once; this one has done so.
    monkeypatch.setattr(registry, "installed", functools.cache(registry.installed.__wrapped__))


def place_of(comment):
    """Return ``file:line`` of the line with that comment."""
    lines = SOURCE.splitlines()
    number = next(n for n, line in enumerate(lines, start=1) if comment in line)
    return f"{MODULE}.py:{number}"


def plug_in(monkeypatch, name, factory):
    """Let a factory of this process be the system under test of kind ``name``."""
    entry = SimpleNamespace(name=name, load=lambda: factory)
    monkeypatch.setitem(registry._BUILT_IN, name, registry.PluggedKind(entry))


def let_time_pass_while(monkeypatch, is_true):
    """Let time pass for limits only while something is true of the frame that is executed.

    Alarms come by the clock of the machine. However late it gets to where it is meant to be
    interrupted, none interrupts it before.
    """

    def monotonic():
        frame = sys._getframe(1)
        while frame.f_code.co_filename == deadline.__file__:
            frame = frame.f_back
        return 10.0 if is_true(frame) else 0.0

    monkeypatch.setattr(deadline, "time", SimpleNamespace(monotonic=monotonic))
