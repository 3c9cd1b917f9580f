"""The daemon's life: lock, ledger, router, local worker; then wait; then leave in order."""

from __future__ import annotations

import fcntl
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from importlib.metadata import version as installed_version
from pathlib import Path
from types import FrameType
from typing import Final

import zenoh

from daemon.batch import bus
from daemon.batch.errors import AlreadyRunning, DaemonError
from daemon.batch.ledger import LedgerReader, LedgerWriter
from daemon.batch.paths import DaemonContact, StatePaths, is_encrypted
from daemon.batch.server._admission import Quota
from daemon.batch.server._askers import Askers, holder_of
from daemon.batch.server._dispatcher import (
    LedgerJob,
    OverloadReply,
    ReaderThread,
    RequestDispatcher,
    WriterThread,
)
from daemon.batch.server._door import Door
from daemon.batch.server._handlers import Handlers
from daemon.batch.server._runtime import (
    DaemonClock,
    DaemonSettings,
    EventLog,
    ListenSettings,
    prepare_endpoints,
)
from daemon.batch.server._workers import LocalWorker, WorkerRegistry
from daemon.batch.stores import check_store_url, write_marker
from daemon.model.execution import DEFAULT_EXECUTOR, RunLimits, available_cores
from daemon.model.messages import ALIVE, ASK, EVENTS, WORK
from daemon.model.status import ChangeEvent
from grammars.text import codec
from grammars.text.files import write_atomically

_LAST_MOMENT: Final = 3.0
"""Seconds a worker has to give its runs back, and then to be killed."""
STOP_MARGIN: Final = 2 * _LAST_MOMENT
"""Seconds a daemon may need to leave after its patience has ended."""
# What makes runs available, or unwanted where they are running: see WORK. All else changes nothing
# for workers, and a hint for every finished run would have each worker ask thousands of times.
_HINTS: Final = frozenset({"submitted", "extended", "retried", "queued", "cancelled", "resumed"})


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

    It listens at the socket of the state directory, and at ``listen`` if that is given: over TLS
    with ``keys``, or plain TCP on loopback, elsewhere only if ``insecure`` is meant.
    ``slots`` is the size of the local worker: ``None`` for one per core, 0 for no local worker.
    ``executor`` (``module:function``) executes runs within ``limits``. With ``tether`` the
    daemon leaves at once when its standard input closes: its parent is gone. The first signal
    lets running runs finish for a while, the second gives them back. To be called from the main
    thread.

    Raises :class:`AlreadyRunning` when another daemon keeps ``state``, and
    :class:`daemon.batch.errors.DaemonError` when the ledger or the endpoint cannot be used.
    """
    settings = _checked(settings or DaemonSettings())
    paths = StatePaths.find(state)
    paths.make_folders()
    with ExitStack() as stack:
        stack.enter_context(_only_one(paths))
        log = EventLog(paths.log)
        stack.callback(log.close)
        listening = prepare_endpoints(paths, listen, keys, insecure=insecure)
        daemon = _Daemon(paths, settings, log, listening)
        stack.enter_context(daemon.signals())
        slots = available_cores() if slots is None else slots
        local = LocalWorker(
            paths,
            log,
            endpoint=listening.socket,
            slots=slots,
            executor=executor,
            limits=limits or RunLimits(),
            tether=tether,
        )
        try:
            daemon.run(stack, local if slots else None, tether)
        except Exception as error:
            log.write("failed", problem=repr(error))
            raise


def _checked(settings: DaemonSettings) -> DaemonSettings:
    try:
        return replace(settings, store=check_store_url(settings.store) if settings.store else "")
    except ValueError as error:
        raise DaemonError(f"traces cannot be kept there: {error}") from error


@contextmanager
def _only_one(paths: StatePaths) -> Iterator[None]:
    with paths.lock.open("a") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            contact = paths.read_contact()
            where = f", process {contact.pid}" if contact else ""
            raise AlreadyRunning(f"a daemon already keeps {paths.state}{where}") from None
        yield


class _Daemon:
    def __init__(
        self,
        paths: StatePaths,
        settings: DaemonSettings,
        log: EventLog,
        listening: ListenSettings,
    ) -> None:
        self._paths = paths
        self._settings = settings
        self._log = log
        self._listening = listening
        self._stops = 0
        self._stopped = threading.Event()
        self._tether_cut = False
        self._clock = DaemonClock()
        # Renewals come every third of a lease: who has missed nine is gone, even though Zenoh still
        # has the connection (a suspended machine, a process stopped in a debugger).
        self._askers = Askers(log, listening.keys)
        self._registry = WorkerRegistry(settings.grace, 3 * settings.lease)
        self._quota = Quota(paths, log, settings.quota, self._clock.now)
        self._version = installed_version("scenario-tui")
        self._local: LocalWorker | None = None
        self._handlers = Handlers(
            paths,
            settings,
            self._registry,
            log,
            self._clock,
            self._quota,
            version=self._version,
            stop=self._stop,
            trouble=self._trouble,
            marker=write_marker(paths),
        )

    @contextmanager
    def signals(self) -> Iterator[None]:
        """Let SIGTERM and SIGINT end the daemon in order."""

        def on_signal(number: int, _: FrameType | None) -> None:
            self._stop()

        kept = {n: signal.signal(n, on_signal) for n in (signal.SIGTERM, signal.SIGINT)}
        try:
            yield
        finally:
            for number, handler in kept.items():
                signal.signal(number, handler)

    def _trouble(self) -> str:
        own = "" if self._local is None else self._local.trouble
        return self._paths.disk_shortage() or self._quota.trouble or own

    def _stop(self) -> None:
        self._stops += 1
        self._stopped.set()

    def run(self, stack: ExitStack, local: LocalWorker | None, tether: bool) -> None:
        """Open everything, work, leave; ``stack`` closes what was opened."""
        self._local = local
        if tether:
            threading.Thread(target=self._watch_tether, daemon=True).start()
        settings = self._settings
        ledger = stack.enter_context(
            LedgerWriter.open(self._paths.ledger, attempts=settings.attempts, lease=settings.lease)
        )
        door = self._open_door(stack)
        session = stack.enter_context(
            bus.open_router(self._zenoh_endpoints(door), self._listening.keys)
        )
        threads = self._start_threads(stack, ledger, session)
        if door is not None:
            door.supervise()
        writer = threads[0]
        self._quota.start()
        stack.callback(self._quota.close)
        # Last, and so withdrawn first: whoever reads where the daemon is finds one that answers.
        self._publish_contact(stack)
        self._log.write("started", endpoints=self._listening.endpoints, pid=os.getpid())
        while not self._stopped.is_set():
            if local is not None:
                local.supervise()
            self._askers.look()
            if door is not None:
                door.supervise()
            # Through the writer's queue: nobody else touches the ledger, and a full disk or a
            # locked file is the value of a job here as for every request.
            writer.put(LedgerJob(self._tick, self._ticked))
            if not all(thread.is_alive() for thread in threads):
                raise DaemonError("a thread of the daemon has failed, see worker.log")
            self._stopped.wait(self._settings.tick)
        self._leave(local)
        self._log.write("stopped")

    def _open_door(self, stack: ExitStack) -> Door | None:
        """Listen where keys are asked for; Zenoh does so behind it."""
        address = self._listening.address
        if not is_encrypted(address):
            return None
        door = Door(address, self._log)
        stack.callback(door.close)
        return door

    def _zenoh_endpoints(self, door: Door | None) -> tuple[str, ...]:
        if door is None:
            return self._listening.endpoints
        return (self._listening.socket, door.behind)

    def _watch_tether(self) -> None:
        while os.read(sys.stdin.fileno(), 4096):
            pass
        self._tether_cut = True
        self._stop()

    def _start_threads(
        self, stack: ExitStack, ledger: LedgerWriter, session: zenoh.Session
    ) -> tuple[WriterThread, ReaderThread, ReaderThread, OverloadReply]:
        # Workers could renew nothing while there was no daemon: none of that is held against them.
        extended = ledger.extend_leases(self._clock.now())
        if extended:
            self._log.write("resumed", leases=extended)
        if self._settings.store:
            ledger.add_store(self._settings.store)
        reader = self._reader(stack, "ledger-reader")
        carrier = self._reader(stack, "carrier")
        writer = WriterThread(ledger, lambda events: _publish(session, events))
        overload = OverloadReply()
        for thread in (overload, reader, carrier, writer):
            thread.start()
            stack.callback(thread.finish)
        dispatcher = RequestDispatcher(
            self._handlers.by_verb, self._log, writer, reader, carrier, overload, self._askers
        )
        # Declared last and so undeclared first: no request arrives without a thread.
        stack.enter_context(
            session.liveliness().declare_subscriber(
                f"{ALIVE}/*/*", self._on_liveliness, history=True
            )
        )
        # The second is how versions before this one asked: they shall hear that they are refused.
        for keys in (f"{ASK}/*/*", f"{ASK}/*"):
            stack.enter_context(session.declare_queryable(keys, dispatcher.on_query))
        return writer, reader, carrier, overload

    def _reader(self, stack: ExitStack, name: str) -> ReaderThread:
        return ReaderThread(name, stack.enter_context(LedgerReader.open(self._paths)))

    def _on_liveliness(self, sample: zenoh.Sample) -> None:
        name, worker = str(sample.key_expr).split("/")[-2:]
        if sample.kind == zenoh.SampleKind.PUT:
            self._registry.connected(worker, holder_of(name))
        else:
            self._registry.disconnected(worker, self._clock.now(), holder_of(name))

    def _publish_contact(self, stack: ExitStack) -> None:
        contact = DaemonContact(self._listening.socket, os.getpid(), self._version, time.time())
        write_atomically(self._paths.contact_file, codec.to_json(contact))
        stack.callback(self._paths.contact_file.unlink, missing_ok=True)

    def _tick(self, ledger: LedgerWriter) -> int:
        moved = self._clock.follow_wall_clock()
        if moved:
            ledger.shift_leases(moved)
            self._registry.shift(moved)
            self._log.write("clock set", seconds=round(moved, 3))
        now = self._clock.now()
        taken = ledger.expire_leases(now)
        if taken:
            self._log.write("leases lapsed", runs=taken)
        for worker in self._registry.remove_gone(now):
            runs = ledger.release_worker(worker, now)
            ledger.record_event(now, "worker", worker, state="gone")
            self._log.write("worker gone", worker=worker, runs=runs)
        return taken

    def _ticked(self, value: object) -> None:
        if isinstance(value, Exception):
            self._log.write("failure", key="tick", problem=repr(value))

    def _leave(self, local: LocalWorker | None) -> None:
        # Others are told that nothing more comes; the local worker is asked to finish what it has
        # (SIGTERM), after the patience to give it back (SIGQUIT: the runs are queued again at once,
        # without blame), at last killed: then the next daemon queues them, when their leases end.
        self._handlers.draining = True
        self._log.write("leaving")
        if local is None or not local.alive:
            return
        local.signal(signal.SIGTERM)
        stops = self._stops
        deadline = time.monotonic() + self._settings.patience
        while time.monotonic() < deadline and self._stops == stops and not self._tether_cut:
            if local.wait(0.1):
                return
        local.signal(signal.SIGQUIT)
        if not local.wait(_LAST_MOMENT):
            local.signal(signal.SIGKILL)
            local.wait(_LAST_MOMENT)


def _publish(session: zenoh.Session, events: list[ChangeEvent]) -> None:
    for event in events:
        # Dropped rather than waited for: a listener that is behind sees the gap and asks again.
        session.put(EVENTS, codec.to_json(event), congestion_control=zenoh.CongestionControl.DROP)
    if any(event.state in _HINTS for event in events):
        session.put(WORK, b"", congestion_control=zenoh.CongestionControl.DROP)
