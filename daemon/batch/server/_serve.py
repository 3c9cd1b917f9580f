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
from daemon.batch.paths import DaemonContact, StatePaths
from daemon.batch.server._dispatcher import (
    LedgerJob,
    OverloadReply,
    ReaderThread,
    RequestDispatcher,
    WriterThread,
)
from daemon.batch.server._handlers import Handlers
from daemon.batch.server._quota import Quota
from daemon.batch.server._runtime import DaemonClock, EventLog
from daemon.batch.server._settings import DaemonSettings, ListenSettings, prepare_endpoints
from daemon.batch.server._workers import LocalWorker, WorkerRegistry
from daemon.batch.stores import check_store_url, write_marker
from daemon.model.execution import DEFAULT_EXECUTOR, RunLimits, available_cores
from daemon.model.messages import ALIVE, ASK, EVENTS, WORK
from daemon.model.status import ChangeEvent
from grammars.text import codec
from grammars.text.files import write_atomically

_LAST_MOMENT: Final = 3.0
STOP_MARGIN: Final = 2 * _LAST_MOMENT
"""Seconds a daemon may need to leave after its patience has ended."""
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
    places = StatePaths.find(state)
    places.make_folders()
    with ExitStack() as stack:
        stack.enter_context(_only_one(places))
        journal = EventLog(places.log)
        stack.callback(journal.close)
        listening = prepare_endpoints(places, listen, keys, insecure=insecure)
        daemon = _Daemon(places, settings, journal, listening)
        stack.enter_context(daemon.signals())
        slots = available_cores() if slots is None else slots
        local = LocalWorker(
            places,
            journal,
            endpoint=listening.socket,
            slots=slots,
            executor=executor,
            limits=limits or RunLimits(),
            tether=tether,
        )
        try:
            daemon.run(stack, local if slots else None, tether)
        except Exception as error:
            journal.write("failed", problem=repr(error))
            raise


def _checked(settings: DaemonSettings) -> DaemonSettings:
    try:
        return replace(settings, store=check_store_url(settings.store) if settings.store else "")
    except ValueError as error:
        raise DaemonError(f"traces cannot be kept there: {error}") from error


@contextmanager
def _only_one(places: StatePaths) -> Iterator[None]:
    with places.lock.open("a") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            contact = places.read_contact()
            where = f", process {contact.pid}" if contact else ""
            raise AlreadyRunning(f"a daemon already keeps {places.state}{where}") from None
        yield


class _Daemon:
    def __init__(
        self,
        places: StatePaths,
        settings: DaemonSettings,
        journal: EventLog,
        listening: ListenSettings,
    ) -> None:
        self._places = places
        self._settings = settings
        self._journal = journal
        self._listening = listening
        self._stops = 0
        self._stopped = threading.Event()
        self._tether_cut = False
        self._clock = DaemonClock()
        self._roster = WorkerRegistry(settings.grace, 3 * settings.lease)
        self._quota = Quota(places, journal, settings.quota, self._clock.now)
        self._version = installed_version("scenario-tui")
        self._local: LocalWorker | None = None
        self._desk = Handlers(
            places,
            settings,
            self._roster,
            journal,
            self._clock,
            self._quota,
            version=self._version,
            stop=self._stop,
            trouble=self._trouble,
            marker=write_marker(places),
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
        return self._places.disk_shortage() or self._quota.trouble or own

    def _stop(self) -> None:
        self._stops += 1
        self._stopped.set()

    def run(self, stack: ExitStack, local: LocalWorker | None, tether: bool) -> None:
        """Open everything, work, leave; ``stack`` closes what was opened."""
        self._local = local
        if tether:
            threading.Thread(target=self._watch_tether, daemon=True).start()
        settings = self._settings
        book = stack.enter_context(
            LedgerWriter.open(self._places.ledger, attempts=settings.attempts, lease=settings.lease)
        )
        session = stack.enter_context(
            bus.open_router(self._listening.endpoints, self._listening.keys)
        )
        clerks = self._start_clerks(stack, book, session)
        writer = clerks[0]
        self._quota.start()
        stack.callback(self._quota.close)
        self._publish_contact(stack)
        self._journal.write("started", endpoints=self._listening.endpoints, pid=os.getpid())
        while not self._stopped.is_set():
            if local is not None:
                local.supervise()
            writer.put(LedgerJob(self._tick, self._ticked))
            if not all(clerk.is_alive() for clerk in clerks):
                raise DaemonError("a thread of the daemon has failed, see worker.log")
            self._stopped.wait(self._settings.tick)
        self._leave(local)
        self._journal.write("stopped")

    def _watch_tether(self) -> None:
        while os.read(sys.stdin.fileno(), 4096):
            pass
        self._tether_cut = True
        self._stop()

    def _start_clerks(
        self, stack: ExitStack, book: LedgerWriter, session: zenoh.Session
    ) -> tuple[WriterThread, ReaderThread, ReaderThread, OverloadReply]:
        settings = self._settings
        extended = book.extend_leases(self._clock.now())
        if extended:
            self._journal.write("resumed", leases=extended)
        if settings.store:
            book.add_store(settings.store)
        questions = self._questions(stack, "ledger-reader")
        carrier = self._questions(stack, "carrier")
        writer = WriterThread(book, lambda events: _publish(session, events))
        doorman = OverloadReply()
        for clerk in (doorman, questions, carrier, writer):
            clerk.start()
            stack.callback(clerk.finish)
        counter = RequestDispatcher(
            self._desk.services, self._journal, writer, questions, carrier, doorman
        )
        # Declared last and so undeclared first: no request arrives without a clerk.
        stack.enter_context(
            session.liveliness().declare_subscriber(f"{ALIVE}/*", self._on_liveliness, history=True)
        )
        stack.enter_context(session.declare_queryable(f"{ASK}/*", counter.receive))
        return writer, questions, carrier, doorman

    def _questions(self, stack: ExitStack, name: str) -> ReaderThread:
        return ReaderThread(name, stack.enter_context(LedgerReader.open(self._places)))

    def _on_liveliness(self, sample: zenoh.Sample) -> None:
        worker = str(sample.key_expr).rpartition("/")[2]
        if sample.kind == zenoh.SampleKind.PUT:
            self._roster.connected(worker)
        else:
            self._roster.disconnected(worker, self._clock.now())

    def _publish_contact(self, stack: ExitStack) -> None:
        contact = DaemonContact(self._listening.socket, os.getpid(), self._version, time.time())
        write_atomically(self._places.contact_file, codec.to_json(contact))
        stack.callback(self._places.contact_file.unlink, missing_ok=True)

    def _tick(self, book: LedgerWriter) -> int:
        moved = self._clock.follow_wall_clock()
        if moved:
            book.shift_leases(moved)
            self._roster.shift(moved)
            self._journal.write("clock set", seconds=round(moved, 3))
        now = self._clock.now()
        taken = book.expire_leases(now)
        if taken:
            self._journal.write("leases lapsed", runs=taken)
        for worker in self._roster.remove_gone(now):
            runs = book.release_worker(worker, now)
            book.record_event(now, "worker", worker, state="gone")
            self._journal.write("worker gone", worker=worker, runs=runs)
        return taken

    def _ticked(self, value: object) -> None:
        if isinstance(value, Exception):
            self._journal.write("failure", key="tick", problem=repr(value))

    def _leave(self, local: LocalWorker | None) -> None:
        self._desk.draining = True
        self._journal.write("leaving")
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
