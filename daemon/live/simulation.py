"""A scenario's world that goes on by the wall clock, at a chosen speed, and waits for nobody."""

from __future__ import annotations

import math
import queue
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final, Protocol

from daemon.live.driver import LiveDriver, OutsideInput, RobotListener
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
"""Speeds that can be asked for [simulated seconds a second]."""

_MOST_LAG: Final = 0.2
"""A world that is so far behind the clock [s] gives the time up instead of rushing after it."""
_SLICE: Final = 0.02
"""How long it computes before it looks at the clock and at what was asked for again [s]."""
_CHUNK: Final = 10
"""Ticks between two looks at the clock."""
_IDLE: Final = 0.05
"""How long it waits at most [s]: so soon does it obey while it is paused."""
_WINDOW: Final = 1.0
"""The reached speed is that of so many seconds of wall clock."""
_VIEW_PERIOD: Final = 0.05
"""Seconds of wall clock between two snapshots while somebody looks."""
_HEARD: Final = 1.0
"""Whose command was carried out is told for so long [s of wall clock]."""


@dataclass(frozen=True, slots=True)
class LiveStatus:
    """How a live world goes: ``time`` simulated [s], ``speed`` asked for, ``reached`` in fact.

    ``late``: time was given up lately because computing took too long. ``driver`` says who
    commands the robot, empty for nobody. ``limit`` is the scenario's, after which drawn behaviours
    have nothing more to do [s]. ``note`` is the last thing that went wrong.
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
    """Who gets the messages of a trace, called by the thread of the simulation only."""

    def send(self, topic: str, now: int, payload: bytes) -> None:
        """Take a message of ``now`` [ns], CDR."""

    def wanted(self, topic: str) -> bool:
        """Whether anybody listens to a topic."""

    def begin(self) -> None:
        """A world begins anew: time jumps back to 0."""

    def status(self, status: LiveStatus) -> None:
        """Take how it goes, after every step."""


class LiveSimulation:
    """The world of a specification, stepped by :meth:`run` or, in tests, by :meth:`step`.

    Whatever is asked of it from other threads (pause, speed, reset) happens at its next step.
    ``sut`` makes a system that drives the robot while nobody else does.

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
        self._asked: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._outside = OutsideInput()
        self._outlets: list[MessageOutlet] = []
        self._listeners: list[RobotListener] = []
        self._speed, self._paused = check_speed(speed), False
        self._late_until = self._view_due = -math.inf
        self._driven: tuple[str, float] = ("", -math.inf)
        self._note = ""
        self._worlds = 0
        self._loop: RunLoop | None = None
        self.status = LiveStatus(0.0, self._speed, self._speed, False, False, "", spec.limit)

    def add_outlet(self, outlet: MessageOutlet) -> None:
        """Have somebody hear all messages; before the first step."""
        self._outlets.append(outlet)

    def add_listener(self, listener: RobotListener) -> None:
        """Have somebody hear what the robot measures; before the first step."""
        self._listeners.append(listener)

    def command(self, twist: Twist2, source: str) -> None:
        """Command a body-frame velocity; the latest of all sources is carried out, once.

        Raises ``ValueError`` for numbers that are not finite.
        """
        self._outside.command(twist, source)

    def report(self, said: Decision) -> None:
        """Show what a stack outside says: estimate, cloud, particles, plans and events of it."""
        self._outside.report(said)

    def pause(self, paused: bool) -> None:
        """Stand still, or go on."""
        self._asked.put(lambda: self._pause(paused))

    def toggle(self) -> None:
        """Stand still if it goes, go on if not."""
        self._asked.put(lambda: self._pause(not self._paused))

    def set_speed(self, speed: float) -> None:
        """Go at ``speed`` simulated seconds a second; raises ``ValueError`` out of range."""
        checked = check_speed(speed)
        self._asked.put(lambda: self._set_speed(checked))

    def reset(self) -> None:
        """Begin the same world anew, from the same seed."""
        self._asked.put(self._begin)

    def run(self, stop: threading.Event) -> None:
        """Step by the clock until ``stop`` is set."""
        while not stop.is_set():
            stop.wait(self.step())

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
        """Do what is due by now; return how long there is nothing to do [s of wall clock]."""
        if self._loop is None:
            self._begin()
        while not self._asked.empty():
            self._asked.get()()
        now = self._clock()
        if self._paused:
            # What is commanded to a world that stands still is not meant for when it goes on.
            self._outside.take_command()
        else:
            self._catch_up(now)
        self._tell(now)
        return self._rest(self._clock())

    def _begin(self) -> None:
        """Build the world and give everybody what holds for all of it."""
        if self._worlds:
            for outlet in self._outlets:
                outlet.begin()
        self._worlds += 1
        self._note = ""
        self._outside.take_command()
        self._outside.take_report()
        stream = MessageStream(self.spec, self.scene, self._send, self._wanted)
        inner = self._make_sut() if self._make_sut is not None else None
        self._stream = stream
        self._driver = LiveDriver(self._outside, inner, tuple(self._listeners), self._commanded)
        self._loop = loop = RunLoop(self.spec, self.scene, stream, sut=self._driver)
        try:
            loop.begin()
        except SutError as error:
            self._dismiss(error)
        self._anchor(self._clock())
        self._measured = (self._clock(), 0.0, self._speed)

    def _anchor(self, now: float) -> None:
        """Count from here: the target is a line through this point, so nothing adds up."""
        assert self._loop is not None
        self._wall, self._start = now, self._loop.world.time

    def _catch_up(self, now: float) -> None:
        loop = self._loop
        assert loop is not None
        world, until = loop.world, now + _SLICE
        target = self._start + (now - self._wall) * self._speed
        # A hair more: a tick that is due at this very instant must not wait for rounding.
        last = math.floor(target * TICK_RATE + 1e-6)
        # Also with nothing to step to, as at tick 0: what is due there is measured and answered.
        more = True
        while more:
            try:
                loop.advance(max(world.tick, min(last, world.tick + _CHUNK)))
            except SutError as error:
                self._dismiss(error)
            more = world.tick < last and self._clock() < until
        if (last - world.tick) / TICK_RATE > _MOST_LAG * self._speed:
            self._late_until = self._clock() + _WINDOW
            self._anchor(self._clock())

    def _dismiss(self, error: SutError) -> None:
        """Go on without the system that crashed."""
        self._driver.dismiss()
        self._note = error.note
        assert self._loop is not None
        time = self._loop.world.time
        for event in error.events:
            self._stream.event(time, event.source, event.text, level=event.level)
        self._stream.event(time, "sut", error.note, level="error")

    def _tell(self, now: float) -> None:
        """Say how it goes, and what there is to see if somebody looks."""
        loop = self._loop
        assert loop is not None
        since, simulated, reached = self._measured
        if now - since >= _WINDOW:
            reached = (loop.world.time - simulated) / (now - since)
            self._measured = (now, loop.world.time, reached)
        driver, until = self._driven
        self.status = LiveStatus(
            time=loop.world.time,
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
            self.view = loop.snapshot(loop.world.time)

    def _rest(self, now: float) -> float:
        loop = self._loop
        assert loop is not None
        if self._paused:
            return _IDLE
        due = self._wall + (loop.next_due() / TICK_RATE - self._start) / self._speed
        return min(max(due - now, 0.0), _IDLE)

    def _pause(self, paused: bool) -> None:
        self._paused = paused
        self._anchor(self._clock())
        self._measured = (self._clock(), self._start, self._speed)

    def _set_speed(self, speed: float) -> None:
        self._speed, self._late_until = speed, -math.inf
        self._anchor(self._clock())
        self._measured = (self._clock(), self._start, self._speed)

    def _commanded(self, source: str) -> None:
        self._driven = (source or self.spec.sut.name, self._clock() + _HEARD)

    def _send(self, topic: str, now: int, payload: bytes) -> None:
        for outlet in self._outlets:
            outlet.send(topic, now, payload)

    def _wanted(self, topic: str) -> bool:
        return any(outlet.wanted(topic) for outlet in self._outlets)


class LiveThread(threading.Thread):
    """Runs a simulation; ``failure`` is what ended it before its time."""

    def __init__(self, simulation: LiveSimulation) -> None:
        super().__init__(name="live simulation", daemon=True)
        self.failure: Exception | None = None
        self._simulation, self._stop_asked = simulation, threading.Event()

    def run(self) -> None:
        """Step until :meth:`end`."""
        try:
            self._simulation.run(self._stop_asked)
        except Exception as error:
            # Told by whoever looks at the world: a thread has nobody to raise to.
            self.failure = error

    def end(self) -> None:
        """Stop stepping and wait for it."""
        self._stop_asked.set()
        self.join()


def check_speed(speed: float) -> float:
    """Return a speed that can be gone at; raises ``ValueError`` for others."""
    if not SLOWEST <= speed <= FASTEST:
        raise ValueError(f"the speed must be between {SLOWEST:g} and {FASTEST:g}, not {speed:g}")
    return speed
