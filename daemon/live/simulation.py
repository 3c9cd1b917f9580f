"""A scenario's world that runs by the wall clock, at a chosen speed, and never waits."""

from __future__ import annotations

import math
import queue
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final, Protocol

from daemon.live.driver import LiveDriver, RobotListener
from daemon.model.spec import RunSpec, Snapshot
from daemon.model.sut import TICK_RATE, Decision, SystemUnderTest
from daemon.run import SceneMismatchError
from daemon.run_loop import RunLoop
from daemon.stacks.calls import SutError
from daemon.trace import MessageStream
from grammars.model.geometry import Twist2
from grammars.model.scene import Scene

SLOWEST: Final = 0.01
FASTEST: Final = 1000.0
"""Limits of the speed [simulated seconds a second]."""

_MOST_LAG: Final = 0.2
"""Lag behind the clock [s] beyond which a world skips time instead of rushing after it."""
_SLICE: Final = 0.02
"""Longest time of computing before requests are handled again [s]."""
_CHUNK: Final = 10
"""Ticks between two looks at the clock."""
_IDLE: Final = 0.05
"""Longest wait [s], and so the longest delay of a request to a paused world."""
_WINDOW: Final = 1.0
"""Window over which the reached speed is measured [s, wall clock]."""
_VIEW_PERIOD: Final = 0.05
"""Period of snapshots while somebody looks [s, wall clock]."""
_DRIVER_SHOWN: Final = 1.0
"""Time for which the source of a command is shown after it [s, wall clock]."""


@dataclass(frozen=True, slots=True)
class LiveStatus:
    """Status of a live world: simulated ``time`` [s], requested ``speed``, ``reached`` speed.

    ``late``: the world skipped time lately because computing took too long. ``driver`` names the
    source of commands, empty without one. ``limit`` is the scenario's [s]; drawn behaviours end
    there. ``note`` is the last error.
    """

    time: float
    speed: float
    reached: float
    paused: bool
    late: bool
    driver: str
    limit: float
    worlds: int = 1
    note: str = ""


class MessageOutlet(Protocol):
    """Receiver of the messages of a trace; called by the thread of the simulation only."""

    def send(self, topic: str, now: int, payload: bytes) -> None:
        """Take a message of ``now`` [ns], CDR."""

    def has_listeners(self, topic: str) -> bool:
        """Return whether anybody listens to a topic."""

    def begin(self) -> None:
        """Begin a world anew: time jumps back to 0."""

    def status(self, status: LiveStatus) -> None:
        """Take the status after every step."""


class LiveSimulation:
    """The world of a specification, stepped by :meth:`running` or, in tests, by :meth:`step`.

    Requests of other threads (pause, speed, reset) take effect at its next step. ``sut`` makes a
    system that drives the robot while no commands come from outside.

    Raises :class:`daemon.run.SceneMismatchError` for another scene than the specified one.
    """

    def __init__(
        self,
        spec: RunSpec,
        scene: Scene,
        *,
        speed: float = 1.0,
        sut: Callable[[], SystemUnderTest] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if scene.digest != spec.scene:
            raise SceneMismatchError(f"scene {scene.digest[:12]} given, {spec.scene[:12]} expected")
        self.spec, self.scene = spec, scene
        self.view: Snapshot | None = None
        self.watched = False
        self._make_sut, self._clock = sut, clock
        self._requests: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._outlets: list[MessageOutlet] = []
        self._listeners: list[RobotListener] = []
        self._speed, self._paused = check_speed(speed), False
        self._late_until = self._view_due = -math.inf
        self._driven: tuple[str, float] = ("", -math.inf)
        self._note = ""
        self._worlds = 0
        self._driver = LiveDriver()
        self._loop: RunLoop  # from the first step on
        self.status = LiveStatus(0.0, self._speed, self._speed, False, False, "", spec.limit)

    def add_outlet(self, outlet: MessageOutlet) -> None:
        """Add a receiver of all messages; before the first step."""
        self._outlets.append(outlet)

    def add_listener(self, listener: RobotListener) -> None:
        """Add a receiver of the robot's measurements; before the first step."""
        self._listeners.append(listener)

    def command(self, twist: Twist2, source: str) -> None:
        """Command a body-frame velocity; the latest of all sources is carried out, once.

        Raises ``ValueError`` for numbers that are not finite.
        """
        self._driver.command(twist, source)

    def report(self, report: Decision) -> None:
        """Show estimate, cloud, particles, plans and events of a stack outside."""
        self._driver.report(report)

    def pause(self, paused: bool) -> None:
        """Pause, or go on."""
        self._requests.put(lambda: self._pause(paused))

    def toggle(self) -> None:
        """Pause a running world, resume a paused one."""
        self._requests.put(lambda: self._pause(not self._paused))

    def set_speed(self, speed: float) -> None:
        """Run at ``speed`` simulated seconds a second; raises ``ValueError`` out of range."""
        checked = check_speed(speed)
        self._requests.put(lambda: self._set_speed(checked))

    def reset(self) -> None:
        """Begin the same world anew, from the same seed."""
        self._requests.put(self._begin)

    @contextmanager
    def running(self) -> Iterator[LiveThread]:
        """Run in a thread of its own as long as the context lasts."""
        thread = LiveThread(self)
        thread.start()
        try:
            yield thread
        finally:
            thread.end()

    def step(self) -> float:
        """Do everything due by now; return the time until the next step [s, wall clock]."""
        if not self._worlds:
            self._begin()
        while not self._requests.empty():
            self._requests.get()()
        now = self._clock()
        if self._paused:
            # Drop commands to a paused world: they are not meant for later.
            self._driver.take_command()
        else:
            self._catch_up(now)
        self._tell(now)
        return self._rest(self._clock())

    def _begin(self) -> None:
        """Build the world and start its driver."""
        if self._worlds:
            for outlet in self._outlets:
                outlet.begin()
        self._worlds += 1
        self._note = ""
        stream = MessageStream(self.spec, self.scene, self._send, self._has_listeners)
        inner = self._make_sut() if self._make_sut is not None else None
        self._stream = stream
        self._driver = LiveDriver(inner, tuple(self._listeners), self._commanded)
        self._loop = RunLoop(self.spec, self.scene, stream, sut=self._driver)
        try:
            self._loop.begin()
        except SutError as error:
            self._dismiss(error)
        self._measure_anew()

    def _anchor(self) -> None:
        """Count from here: the target is a line through this point, so errors do not add up."""
        self._wall, self._start = self._clock(), self._loop.world.time

    def _measure_anew(self) -> None:
        """Count and measure the reached speed from here."""
        self._anchor()
        self._measured = (self._clock(), self._start, self._speed)

    def _catch_up(self, now: float) -> None:
        world, until = self._loop.world, now + _SLICE
        target = self._start + (now - self._wall) * self._speed
        # Rounding must not delay a tick that is due at this instant.
        last = math.floor(target * TICK_RATE + 1e-6)
        # Once at least: at tick 0 the first measurements are due without a step.
        more = True
        while more:
            try:
                self._loop.advance(max(world.tick, min(last, world.tick + _CHUNK)))
            except SutError as error:
                self._dismiss(error)
            more = world.tick < last and self._clock() < until
        if (last - world.tick) / TICK_RATE > _MOST_LAG * self._speed:
            self._late_until = self._clock() + _WINDOW
            self._anchor()

    def _dismiss(self, error: SutError) -> None:
        """Go on without the system that crashed."""
        self._driver.dismiss()
        self._note = error.note
        time = self._loop.world.time
        for event in error.events:
            self._stream.event(time, event.source, event.text, level=event.level)
        self._stream.event(time, "sut", error.note, level="error")

    def _tell(self, now: float) -> None:
        """Publish the status, and a snapshot if somebody looks."""
        time = self._loop.world.time
        since, simulated, reached = self._measured
        if now - since >= _WINDOW:
            reached = (time - simulated) / (now - since)
            self._measured = (now, time, reached)
        driver, until = self._driven
        self.status = LiveStatus(
            time=time,
            speed=self._speed,
            reached=reached,
            paused=self._paused,
            late=now < self._late_until,
            driver=driver if now < until else "",
            limit=self.spec.limit,
            worlds=self._worlds,
            note=self._note,
        )
        for outlet in self._outlets:
            outlet.status(self.status)
        if self.watched and now >= self._view_due:
            self._view_due = now + _VIEW_PERIOD
            self.view = self._loop.snapshot(time)

    def _rest(self, now: float) -> float:
        if self._paused:
            return _IDLE
        due = self._wall + (self._loop.next_due() / TICK_RATE - self._start) / self._speed
        return min(max(due - now, 0.0), _IDLE)

    def _pause(self, paused: bool) -> None:
        self._paused = paused
        self._measure_anew()

    def _set_speed(self, speed: float) -> None:
        self._speed, self._late_until = speed, -math.inf
        self._measure_anew()

    def _commanded(self, source: str) -> None:
        self._driven = (source or self.spec.sut.name, self._clock() + _DRIVER_SHOWN)

    def _send(self, topic: str, now: int, payload: bytes) -> None:
        for outlet in self._outlets:
            outlet.send(topic, now, payload)

    def _has_listeners(self, topic: str) -> bool:
        return any(outlet.has_listeners(topic) for outlet in self._outlets)


class LiveThread(threading.Thread):
    """Runs a simulation; ``failure`` is the error that ended it."""

    def __init__(self, simulation: LiveSimulation) -> None:
        super().__init__(name="live simulation", daemon=True)
        self.failure: Exception | None = None
        self._simulation, self._stop_asked = simulation, threading.Event()

    def run(self) -> None:
        """Step until :meth:`end`."""
        try:
            while not self._stop_asked.is_set():
                self._stop_asked.wait(self._simulation.step())
        except Exception as error:
            # A thread cannot raise to anybody: the view of the world reports it.
            self.failure = error

    def end(self) -> None:
        """Stop stepping and wait for it."""
        self._stop_asked.set()
        self.join()


def check_speed(speed: float) -> float:
    """Return a valid speed; raises ``ValueError`` for others."""
    if not SLOWEST <= speed <= FASTEST:
        raise ValueError(f"the speed must be between {SLOWEST:g} and {FASTEST:g}, not {speed:g}")
    return speed
