"""What a benchmark says: one value, beside a reference from the same run, with its goals.

The speed of a machine changes by the minute, so a value alone says little. A reference is something
else that does the same work and was measured in turns with it, in the same process or by the same
run: another library, a plain version, the same with less to do, an older commit. What disturbs one
disturbs the other, so their ratio is what to compare between machines and days.
"""

import time
from dataclasses import dataclass, replace

import numpy as np
import psutil


@dataclass(frozen=True, slots=True)
class Goal:
    """What a value, or its ratio to the reference, should reach.

    Attributes:
        bound: in the unit of the value; without unit for a ratio.
        at_least: whether more is better.
        of_ratio: whether the ratio to the reference is meant, which does not depend on the machine.
    """

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
    """One line of a benchmark.

    Attributes:
        name: what was measured, for people.
        value: what came out, the best or the median of several times where noise matters.
        unit: of ``value`` and of the reference's.
        reference: what it is held against; ``None`` where nothing does the same.
        goals: empty where there is no bound to keep.
        note: what else there is to know: sizes, differences, counts.
    """

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

    def judged(self, goal):
        """The number that ``goal`` is about: the value, or the ratio where there is one."""
        return self.ratio if goal.of_ratio else self.value

    def met(self, goal):
        """Whether ``goal`` is reached; one of a ratio is not where the reference is missing."""
        judged = self.judged(goal)
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


def side_by_side(works, repeats):
    """Do each piece of work in turns, and yield its median CPU time [ms] beside the first's."""
    took = {name: 1e3 * float(np.median(t)) for name, t in in_turns(works, repeats).items()}
    first, *others = took
    for name in others:
        yield Measurement(name, took[name], "ms", Reference(first, took[first]))
