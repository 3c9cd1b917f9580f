"""The daemon: lock, ledger, router, local worker; then waiting; then an orderly end."""

from __future__ import annotations

import os
import signal
import threading
import time
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import version as installed_version
from pathlib import Path
from typing import Final

import zenoh

from daemon.batch import bus
from daemon.batch.errors import DaemonError
from daemon.batch.ledger import LedgerWriter
from daemon.batch.paths import DaemonContact, StatePaths
from daemon.batch.server._dispatcher import RequestDispatcher, RevokedKeys
from daemon.batch.server._handlers import Handlers
from daemon.batch.server._housekeeping import Housekeeping, TraceMover
from daemon.batch.server._opening import (
    ListenSettings,
    hold_alone,
    open_state,
    prepare_endpoints,
    write_contact,
)
from daemon.batch.server._processes import LocalWorker
from daemon.batch.server._runtime import DaemonSettings, EventLog
from daemon.batch.server._threads import (
    JobQueue,
    LedgerJob,
    ReaderPool,
    WriterThread,
)
from daemon.batch.server._workers import LeaseClock, LeaseDeadlines, WorkerRegistry
from daemon.batch.stores import Marker, check_store_url
from daemon.model.execution import DEFAULT_EXECUTOR, RunLimits, available_cores
from daemon.model.messages import ALIVE, ASK, EVENTS, WORK
from daemon.model.status import ChangeEvent, Preparation, PreparationPhase, Trouble, TroubleCause
from daemon.model.verbs import ServerThread
from daemon.supervision.child import when_stdin_ends
from grammars.text import codec

_READERS: Final = 4
"""Threads that answer read requests."""
_LAST_MOMENT: Final = 3.0
"""Time for a worker to return its runs, and again to be killed [s]."""
STOP_MARGIN: Final = 2 * _LAST_MOMENT
"""Longest time of a daemon's end after its patience [s]."""
# Events that make runs available, or end running ones: see WORK. Others do not matter to workers,
# and a hint for every finished run would make each worker ask thousands of times.
_HINTS: Final = frozenset(
    {"submitted", "extended", "retried", "queued", "cancelled", "resumed", "superseded"}
)


def serve(
    state: Path,
    *,
    listen: str = "",
    keys: Path | None = None,
    insecure: bool = False,
    slots: int | None = None,
    settings: DaemonSettings | None = None,
    executor: str = DEFAULT_EXECUTOR,
    limits: RunLimits | None = None,
    tether: bool = False,
) -> None:
    """Run the daemon on a state directory until SIGTERM, SIGINT or a shutdown request.

    It listens at the socket of the state directory, and at ``listen`` if given: over TLS with
    ``keys``, or plain TCP, which beyond loopback needs ``insecure``. ``slots`` is the size of the
    local worker: ``None`` for one per core, 0 for no local worker. ``executor``
    (``module:function``) executes runs within ``limits``. With ``tether`` the daemon stops at once
    when its standard input closes: its parent is gone. The first signal lets running runs finish
    for a while, the second returns them. Call it from the main thread.

    Raises :class:`AlreadyRunning` when another daemon keeps ``state``, and
    :class:`daemon.batch.errors.DaemonError` when the ledger or the endpoint cannot be used.
    """
    settings = _checked(settings or DaemonSettings())
    paths = StatePaths.find(state)
    with ExitStack() as stack:
        stack.enter_context(hold_alone(paths))
        log = EventLog(paths.log)
        stack.callback(log.close)
        listening = prepare_endpoints(paths, listen, keys, insecure=insecure)
        stop = StopRequest()
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: stop())
        if tether:
            when_stdin_ends(stop.cut_tether)
        order = {
            "connect": listening.socket,
            "slots": available_cores() if slots is None else slots,
            "executor": executor,
            "limits": asdict(limits or RunLimits()),
            "tether": "exit" if tether else "finish",
        }
        local = LocalWorker(paths, log, order) if order["slots"] else None
        try:
            ledger, marker = open_state(stack, paths, settings, log)
            _Daemon(paths, settings, log, listening, stop, ledger, marker, local).run(stack)
        except Exception as error:
            log.write("failed", problem=repr(error))
            raise


def _checked(settings: DaemonSettings) -> DaemonSettings:
    try:
        return replace(settings, store=check_store_url(settings.store) if settings.store else "")
    except ValueError as error:
        raise DaemonError(f"traces cannot be stored there: {error}") from error


class StopRequest:
    """Number of requests to stop the daemon; ``tether_cut`` after the end of its parent.

    Safe to use from any thread and from signal handlers.
    """

    def __init__(self) -> None:
        self.count = 0
        self.tether_cut = False
        self._requested = threading.Event()

    def __call__(self) -> None:
        """Request a stop."""
        self.count += 1
        self._requested.set()

    def wait(self, seconds: float) -> bool:
        """Wait for a request; return whether there was one."""
        return self._requested.wait(seconds)

    def cut_tether(self) -> None:
        """Request a stop, since the parent has ended."""
        self.tether_cut = True
        self()


@dataclass
class _Daemon:
    paths: StatePaths
    settings: DaemonSettings
    log: EventLog
    listening: ListenSettings
    stop: StopRequest
    ledger: LedgerWriter
    marker: Marker
    local: LocalWorker | None

    def __post_init__(self) -> None:
        self._clock = LeaseClock(self.settings.tick)
        self._deadlines = LeaseDeadlines(self.settings.lease, self._clock)
        self._revoked = RevokedKeys(self.log, self.listening.keys)
        # Renewals come every third of a lease: a worker that has missed three is away, even with a
        # connection of Zenoh (a suspended machine, a process stopped in a debugger).
        self._registry = WorkerRegistry(self.settings.lease, self._clock)
        self._housekeeping = Housekeeping(self.paths, self.log, self.settings.quota)
        self._version = installed_version("scenario-tui")
        self._handlers = Handlers(
            self.paths,
            self.settings,
            self._registry,
            self.log,
            self._deadlines,
            self._housekeeping,
            version=self._version,
            stop=self.stop,
            troubles=self._troubles,
            marker=self.marker,
            starting=self._starting,
        )

    def _troubles(self) -> tuple[Trouble, ...]:
        """Return the troubles that block all runs here, the most urgent first."""
        troubles = (
            Trouble(self.paths.disk_shortage(), TroubleCause.SPACE),
            Trouble(self._housekeeping.trouble, TroubleCause.SPACE),
            Trouble("" if self.local is None else self.local.trouble, TroubleCause.OTHER),
        )
        return tuple(trouble for trouble in troubles if trouble.words)

    def _starting(self) -> Preparation | None:
        """Return the preparation of the daemon's own worker until it reports its own."""
        local = self.local
        if local is None or local.trouble or self.stop.count:
            return None
        is_registered = any(row.pid == local.pid for row in self._registry.rows())
        return None if is_registered else Preparation(PreparationPhase.STARTING)

    def run(self, stack: ExitStack) -> None:
        """Open the bus, work, and end; ``stack`` closes everything."""
        session = stack.enter_context(
            bus.open_router(self.listening.endpoints, self.listening.keys)
        )
        writer = self._start_threads(stack, session)
        keepers: list[Housekeeping | TraceMover] = [self._housekeeping]
        if self.settings.store:
            keepers.append(TraceMover(self.paths, self.log, self.settings.store, writer))
        for keeper in keepers:
            keeper.start()
            stack.callback(keeper.close)
        # Last, and so removed first: a daemon with a contact file answers.
        remove_contact = partial(self.paths.contact_file.unlink, missing_ok=True)
        remove_contact()  # a killed daemon may have left one
        stack.callback(remove_contact)
        where = self.listening.socket
        contact = DaemonContact(where, os.getpid(), self._version, time.time())
        self.log.write("started", endpoints=self.listening.endpoints, pid=os.getpid())
        while not self.stop.count:
            write_contact(self.paths, contact)
            self._revoked.look()
            if self.local is not None:
                self.local.supervise()
            # Through the writer's queue: only the writer changes the ledger, and errors of the disk
            # are the value of a job, as for every request.
            writer.put(LedgerJob(self._tick, self._ticked))
            if not writer.alive:
                raise DaemonError("a thread of the daemon has failed, see worker.log")
            self.stop.wait(self.settings.tick)
        self._leave()
        self.log.write("stopped")

    def _start_threads(self, stack: ExitStack, session: zenoh.Session) -> WriterThread:
        def report(problem: str) -> None:
            self.log.write("checkpoint", problem=problem)

        if leases := self.ledger.leases():
            self.log.write("resumed", leases=len(leases))
        overload = ReaderPool(self.paths, "overload")
        reader = ReaderPool(self.paths, "reader", _READERS)
        carrier = ReaderPool(self.paths, "carrier")
        writer = WriterThread(self.ledger, partial(_publish, session), report)
        # The preparer queues jobs for the writer, and so finishes first.
        preparer = ReaderPool(self.paths, "preparer")
        for jobs in (overload, reader, carrier, writer, preparer):
            stack.callback(jobs.finish)
        queues: dict[ServerThread, JobQueue] = {
            ServerThread.READER: reader,
            ServerThread.CARRIER: carrier,
            ServerThread.WRITER: writer,
        }
        dispatcher = RequestDispatcher(
            self._handlers.by_verb, self.log, queues, preparer, overload, self._revoked
        )
        # Declared last and so undeclared first: no request arrives without a thread.
        stack.enter_context(
            session.liveliness().declare_subscriber(
                f"{ALIVE}/*/*", self._on_liveliness, history=True
            )
        )
        stack.enter_context(session.declare_queryable(f"{ASK}/*/*", dispatcher.on_query))
        return writer

    def _on_liveliness(self, sample: zenoh.Sample) -> None:
        worker = str(sample.key_expr).rpartition("/")[2]
        if sample.kind == zenoh.SampleKind.PUT:
            self._registry.connected(worker)
        else:
            self._registry.disconnected(worker)

    def _tick(self, ledger: LedgerWriter) -> None:
        stalled = self._clock.advance(time.monotonic())
        if stalled:
            self.log.write("stalled", seconds=round(stalled, 3))
        now = time.time()
        overdue = self._deadlines.overdue(ledger.leases())
        if overdue:
            ledger.lapse(overdue, now)
            self.log.write("leases lapsed", runs=len(overdue))
        absent = self._registry.absent()
        if absent:
            # Workers with a lease may come back.
            for worker in self._registry.forget(sorted(absent - ledger.busy_workers())):
                ledger.record_event(now, "worker", worker, state="gone")
                self.log.write("worker gone", worker=worker)

    def _ticked(self, value: object) -> None:
        if isinstance(value, Exception):
            self.log.write("failure", key="tick", problem=repr(value))

    def _leave(self) -> None:
        # Other workers get no more runs. The local worker may finish its runs (SIGTERM). After the
        # patience it returns them (SIGQUIT: they are queued again at once, without blame). At last
        # it is killed: the next daemon queues them when their leases end.
        self._handlers.draining = True
        self.log.write("leaving")
        local = self.local
        if local is None or local.wait(0.0):
            return
        local.signal(signal.SIGTERM)
        deadline = time.monotonic() + self.settings.patience
        # Counts all requests so far: the second may have come before this line.
        while time.monotonic() < deadline and self.stop.count < 2:
            if self.stop.tether_cut:
                break
            if local.wait(0.1):
                return
        local.signal(signal.SIGQUIT)
        if not local.wait(_LAST_MOMENT):
            local.signal(signal.SIGKILL)
            local.wait(_LAST_MOMENT)


def _publish(session: zenoh.Session, events: list[ChangeEvent]) -> None:
    for event in events:
        # Drop instead of waiting: a slow listener sees the gap and asks again.
        session.put(EVENTS, codec.to_json(event), congestion_control=zenoh.CongestionControl.DROP)
    if any(event.state in _HINTS for event in events):
        session.put(WORK, b"", congestion_control=zenoh.CongestionControl.DROP)
