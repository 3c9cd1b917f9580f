"""What a benchmark says: one value, beside a reference from the same run, with its goals.

The speed of a machine changes by the minute, so a value alone says little. A reference is something
else that does the same work and was measured in turns with it, in the same process or by the same
run: another library, a plain version, the same with less to do, an older commit. What disturbs one
disturbs the other, so their ratio is what to compare between machines and days.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, replace

import numpy as np
import psutil

from tests.parts import ROOT


@dataclass(frozen=True, slots=True)
class Goal:
    """What a value should reach, or its ratio to the reference, whatever the machine."""

    bound: float
    at_least: bool
    of_ratio: bool = False


def at_least(bound, *, of_ratio=False):
    """A goal for which more is better."""
    return Goal(bound, True, of_ratio)


def at_most(bound, *, of_ratio=False):
    """A goal for which less is better."""
    return Goal(bound, False, of_ratio)


@dataclass(frozen=True, slots=True)
class Reference:
    """What was measured beside: its name, and its value in the unit of the measurement."""

    name: str
    value: float


@dataclass(frozen=True, slots=True)
class Measurement:
    """One line of a benchmark: the best or the median of several times where noise matters."""

    name: str
    value: float
    unit: str
    reference: Reference | None = None
    goals: tuple[Goal, ...] = ()
    note: str = ""

    @property
    def ratio(self):
        """The value divided by the reference's."""
        if self.reference is None or not self.reference.value:
            return None
        return self.value / self.reference.value

    def met(self, goal):
        """Whether ``goal`` is reached; one of a ratio is not where the reference is missing."""
        judged = self.ratio if goal.of_ratio else self.value
        if judged is None:
            return False
        return judged >= goal.bound if goal.at_least else judged <= goal.bound


_SECONDS = {"s": 1.0, "CPU s": 1.0, "ms": 1e3, "CPU ms": 1e3, "us": 1e6, "CPU us": 1e6}
_SPEEDS = ("x real time", "/s")
_MEMORY = {"MB": 1e6, "MiB": 2.0**20}


def yardstick():
    """CPU seconds of a fixed piece of Python and numpy, the best of some: how quick it is now."""
    return min(in_turns({"": _fixed_work}, 3)[""])


def _fixed_work():
    random, counted = np.random.default_rng(1), {}
    for k in range(40):
        numbers = np.sort(random.standard_normal(500)).cumsum()
        for value in numbers.tolist():
            counted[int(value) % 97] = k


def beside_yardstick(one, seconds):
    """Give a time or a speed without a reference the yardstick as one, memory this process."""
    if one.reference is not None or not seconds:
        return one
    if one.unit in _SECONDS:
        return replace(one, reference=Reference("yardstick", seconds * _SECONDS[one.unit]))
    if one.unit in _SPEEDS:
        return replace(one, reference=Reference("yardsticks a second", 1.0 / seconds))
    if one.unit in _MEMORY:
        own = psutil.Process().memory_info().rss / _MEMORY[one.unit]
        return replace(one, reference=Reference("RSS of this process", own))
    return one


def in_turns(works, repeats, clock=time.process_time):
    """Do each piece of work ``repeats`` times, every other round backwards; seconds of each."""
    took = {name: [] for name in works}
    for k in range(repeats):
        names = list(works)
        for name in names if k % 2 == 0 else reversed(names):
            start = clock()
            works[name]()
            took[name].append(clock() - start)
    return took


def microseconds(work, times=1):
    """Return the CPU time of one call of ``work``, called ``times`` times [us]."""
    begin = time.thread_time()
    for _ in range(times):
        work()
    return (time.thread_time() - begin) / times * 1e6


def cpu(pid):
    """Return the CPU seconds of a process so far."""
    used = psutil.Process(pid).cpu_times()
    return used.user + used.system


def spread(name, milliseconds, *goals):
    """Return a measurement of the median of times [ms], the 99th percentile noted."""
    note = f"99 %: {np.percentile(milliseconds, 99):.2f} ms"
    return Measurement(name, float(np.median(milliseconds)), "ms", None, goals, note)


def side_by_side(works, repeats, unit="ms", each=1):
    """Do each piece of work, the same ``each`` times, in turns; yield medians beside the first."""
    scale = _SECONDS[unit] / each
    took = in_turns(works, repeats, time.thread_time)
    first, *others = ((name, scale * float(np.median(times))) for name, times in took.items())
    for name, value in others:
        yield Measurement(name, value, unit, Reference(*first))


def told(function, *arguments, **environment):
    """Call a function of a module in a process of its own, and return what it returns (JSON)."""
    program = (
        f"import json, sys; from {function.__module__} import {function.__name__} as asked;"
        "said = asked(*json.loads(sys.argv[1])); print(json.dumps(said))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, json.dumps(arguments)],
        cwd=ROOT, env=os.environ | environment, stdout=subprocess.PIPE, text=True, check=True,
    )  # fmt: skip
    return json.loads(done.stdout.splitlines()[-1])


def kept_bytecode(**more):
    """Return the environment of commands as people have them: their bytecode stays on disk."""
    kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    return kept | more


def cpu_of(command, environment, folder=ROOT):
    """Return CPU seconds of a process and those it waits for; raise what it says if it fails."""
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen(
            command, cwd=folder, env=environment, stdout=output, stderr=output
        )
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            output.seek(0)
            raise RuntimeError(f"{command}: {output.read().decode()}")
    return usage.ru_utime + usage.ru_stime
