"""The worker's loop: leases runs, has them executed, publishes their live views, delivers results.

One loop in one thread. It never takes the daemon's word for granted: whatever was not
acknowledged is asked, renewed or delivered again, across restarts of daemon and worker. A run is
watched while somebody subscribes to its own key; whoever executes it is told by a file in the
attempt's folder, and makes the details then only.

What becomes of a lease here:

    leased ──▶ executing ──▶ finished: outbox ──▶ delivered, forgotten
       │           ├───────▶ ended without a result: released, blamed or not
       │           └───────▶ not wanted any more (cancelled, leased by others): stopped, forgotten
       └─ no disk, no process, no scene: released, not blamed
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any, Final

import zenoh

from daemon.batch.errors import DaemonError, Refused, Unreachable
from daemon.batch.run_process import WATCHED
from daemon.batch.worker._attempts import Attempt, AttemptEnd, Backend, Execution, Spool
from daemon.batch.worker._connection import DaemonConnection, InputCache, WorkerPaths
from daemon.batch.worker._signals import WorkerSignals
from daemon.batch.worker._uploader import ResultUploader
from daemon.model.execution import RunLimits
from daemon.model.messages import (
    LIVE,
    OWNER,
    Lease,
    LeaseRef,
    LeaseRequest,
    ReleaseRequest,
    RenewRequest,
    WorkerInfo,
)
from daemon.model.verbs import LEASE, RELEASE, RENEW

_LIVE_PERIOD: Final = 0.2
"""Seconds between two snapshots of a run for those who watch all runs, at least."""


@dataclass(slots=True)
class _WatchedRun:
    """One run under way: its own publisher, and whether its folder says that it is watched."""

    publisher: zenoh.Publisher
    folder: Path
    watched: bool = False
    published_at: float = 0.0


@dataclass(slots=True)
class LivePublisher:
    """Publishes what executions tell of themselves, under ``worker`` and the name of its key."""

    session: zenoh.Session
    worker: str
    name: str = OWNER
    _all: zenoh.Publisher = field(init=False)
    _runs: dict[str, _WatchedRun] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self._all = self._publisher(f"{LIVE}/{self.name}/{self.worker}")

    def _publisher(self, key: str) -> zenoh.Publisher:
        # Telemetry, never the record. With BLOCK a frozen daemon stops this loop for 5 s, and then
        # the transport is closed and everything on it lost.
        drop = zenoh.CongestionControl.DROP
        return self.session.declare_publisher(key, congestion_control=drop)

    def publish(self, execution: Execution) -> None:
        """Pass on what an execution last said of itself, to those who want it."""
        live, execution.live = execution.live, b""
        if not live:
            return
        watch = self._watch(execution)
        now = time.monotonic()
        if watch.watched:
            watch.publisher.put(live)
        if now - watch.published_at >= _LIVE_PERIOD and _has_subscribers(self._all):
            watch.published_at = now
            self._all.put(live)

    def _watch(self, execution: Execution) -> _WatchedRun:
        run, folder = execution.attempt.lease.run, execution.attempt.folder
        watch = self._runs.get(run)
        if watch is None or watch.folder != folder:
            self.forget(run)
            key = f"{LIVE}/{self.name}/{self.worker}/{run}"
            watch = self._runs[run] = _WatchedRun(self._publisher(key), folder)
        watched = _has_subscribers(watch.publisher)
        if watched != watch.watched:
            watch.watched = watched
            mark = folder / WATCHED
            if watched:
                mark.touch()
            else:
                mark.unlink(missing_ok=True)
        return watch

    def forget(self, run: str) -> None:
        """Let go of a run that is over here."""
        watch = self._runs.pop(run, None)
        if watch is not None:
            watch.publisher.undeclare()  # type: ignore[no-untyped-call]


def _has_subscribers(publisher: zenoh.Publisher) -> bool:
    """Whether anybody subscribes.

    The status is declared as a bool but is an object, which is always true (zenoh 1.10.2).
    """
    return bool(publisher.matching_status.matching)  # type: ignore[attr-defined]


_POLL: Final = 1.0
"""Seconds between two requests for work: hints that there is some are sent once, unconfirmed."""
_RETRY_UNREACHABLE: Final = 0.5
"""Seconds to the next try when nobody answers: Zenoh itself connects again within 0.1 to 2 s."""
_DELIVERY_PAUSE: Final = 0.05
"""Seconds between two turns of a large trace; the end of a run is noticed at once anyway."""
_RETRY_FAILED: Final = 3.0
"""Seconds after a full disk or a missing scene: nothing that mends itself at once."""
_LEAVE_TIMEOUT: Final = 10.0
"""Seconds a leaving worker waits for a daemon that takes its results; then the spool has them.

Traces that are on their way go on.
"""


class WorkerLoop:
    """A worker's loop; :meth:`run` returns when its signals say so and its work is done."""

    def __init__(
        self,
        daemon: DaemonConnection,
        info: Callable[[int], WorkerInfo],
        paths: WorkerPaths,
        spool: Spool,
        backend: Backend,
        signals: WorkerSignals,
        *,
        limits: RunLimits,
        renew: float,
        log: Callable[[str], None],
    ) -> None:
        self._daemon = daemon
        self._info = info
        self._paths = paths.state
        self._uploader = ResultUploader(daemon, info(0).id, paths, log)
        self._inputs = InputCache(daemon, paths, self._renew)
        # Leased, not started yet: renewed while scenes and files for the ones before are fetched.
        self._leased: deque[Lease] = deque()
        self._spool = spool
        self._backend = backend
        self._signals = signals
        self._limits = limits
        self._renew_period = renew
        self._log = log
        self._executions: list[Execution] = []
        self._outbox: list[Attempt] = []
        self._releases: list[ReleaseRequest] = []
        self._renew_at = 0.0
        self._lease_at = 0.0
        self._silent_until = 0.0
        self._troubled_until = 0.0
        self._deliver_at = 0.0
        self._overdue = False
        self._leave_by = 0.0
        self._moved = 0
        self._refusal = ""
        # Kinds of systems under test that are not installed here: no run of them is leased again.
        self._missing_suts: dict[str, None] = {}
        self._live = LivePublisher(daemon.session, info(0).id, daemon.name)

    def run(self) -> None:
        """Work until told to leave, then finish or give back what is under way."""
        while not self._signals.abort:
            self._collect_results()
            self._talk_to_daemon()
            if self._signals.drain and not self._executions and self._may_leave():
                return
            self._wait()
        self._give_up()

    def _may_leave(self) -> bool:
        # Results that nobody takes do not keep a worker for ever: the spool keeps them. The limit
        # begins anew whenever something of a trace arrives.
        now = time.monotonic()
        if self._uploader.moved != self._moved:
            self._moved, self._leave_by = self._uploader.moved, 0.0
        self._leave_by = self._leave_by or now + _LEAVE_TIMEOUT
        return now > self._leave_by or not (self._outbox or self._releases)

    def _wait(self) -> None:
        now = time.monotonic()
        moments = [now + _POLL, max(self._renew_at, self._silent_until)]
        moments += [execution.deadline for execution in self._executions]
        if self._outbox or self._releases:
            moments.append(max(self._silent_until, self._deliver_at, now + _DELIVERY_PAUSE))
        pause = max(0.0, min(moments) - now)
        things: list[Any] = [self._signals.receiver, *self._backend.waitables]
        for execution in self._executions:
            things += execution.waitables
        wait(things, max(pause, 0.001))  # 0 would spin while a deadline passes
        if self._signals.take_wakeups():
            # Something came to the queue, or something that runs here is not wanted any more.
            self._lease_at = self._renew_at = 0.0

    def _collect_results(self) -> None:
        self._backend.listen()
        for execution in tuple(self._executions):
            execution.listen()
            self._live.publish(execution)
            if execution.end is not None:
                self._take_ended(execution)

    def _take_ended(self, execution: Execution) -> None:
        self._executions.remove(execution)
        self._live.forget(execution.attempt.lease.run)
        self._lease_at = 0.0
        execution.listen()  # its last words may have come after the ones just read
        end = execution.end or AttemptEnd()
        if execution.attempt.finished:
            self._outbox.append(execution.attempt)
        elif end.sut_missing:
            self._give_back_missing_sut(execution.attempt, end.why)
        else:
            self._give_back(execution.attempt, end.why, blame=end.counts)
        execution.close()

    def _give_back_missing_sut(self, attempt: Attempt, why: str) -> None:
        """Give a run back whose system under test is not installed here, and lease no such."""
        kind, me = attempt.lease.spec.sut.kind, self._info(0)
        self._missing_suts[kind] = None
        remedy = f'install what brings the system under test "{kind}" for worker {me.id}'
        self._give_back(attempt, f"{why}\n{remedy} on {me.host}, and start it again", blame=False)

    def _give_back(self, attempt: Attempt, why: str, *, blame: bool) -> None:
        lease = attempt.lease
        self._log(f"{lease.run} attempt {lease.attempt}: {why}")
        self._releases.append(ReleaseRequest(self._info(0).id, lease.run, lease.token, why, blame))
        attempt.discard()

    def _talk_to_daemon(self) -> None:
        if time.monotonic() < self._silent_until:
            return
        try:
            # In this order: what is delivered or given back needs no renewal, and frees the slots
            # that are leased for next. Leases that are old are renewed before new ones are asked
            # for: fetching what those need may take longer than the old ones last.
            self._deliver()
            self._renew()
            self._lease()
            self._refusal = ""
        except Unreachable:
            self._silent_until = time.monotonic() + _RETRY_UNREACHABLE
            self._renew_at = 0.0  # a new daemon hears first what runs here
        except Refused as error:
            if str(error) != self._refusal:  # it is asked again every second, and says the same
                self._log(f"the daemon refused: {error}")
            self._refusal = str(error)
            self._silent_until = time.monotonic() + _POLL

    def _deliver(self) -> None:
        while self._releases:
            self._release(self._releases[0])
            self._releases.pop(0)
        if time.monotonic() < self._deliver_at:
            return
        for attempt in tuple(self._outbox):
            try:
                delivered = self._uploader.deliver(attempt)
            except (Refused, ValueError) as error:
                # Never to be taken: not a run of this ledger, or damaged in the spool.
                self._outbox.remove(attempt)
                self._give_back(attempt, f"the result was not taken: {error}", blame=True)
            except OSError as error:
                # A full disk, say: the spool keeps it.
                self._log(f"{attempt.lease.run}: delivered later, {error}")
                self._deliver_at = time.monotonic() + _RETRY_FAILED
            else:
                if not delivered:
                    return  # a large trace: other duties come in between
                self._outbox.remove(attempt)
                attempt.discard()

    def _release(self, release: ReleaseRequest) -> None:
        try:
            self._daemon.ask(RELEASE, release)
        except Refused as error:
            # Somebody else's by now, or forgotten: there is nothing left to give back.
            self._log(f"{release.run}: {error}")

    def _busy(self) -> WorkerInfo:
        return self._info(len(self._executions))

    def _renew(self) -> None:
        if time.monotonic() < self._renew_at:
            return
        # First, so that what a dead worker finished is held from now on and not leased anew.
        self._outbox += self._spool.adopt()
        attempts = [execution.attempt for execution in self._executions] + self._outbox
        leases = [*(attempt.lease for attempt in attempts), *self._leased]
        holds = tuple(LeaseRef(lease.run, lease.token) for lease in leases)
        reply = self._daemon.ask(RENEW, RenewRequest(self._busy(), holds))
        self._renew_at = time.monotonic() + self._renew_period
        gone = {hold.token for hold in reply.gone}
        self._overdue = any(a.finished and a.lease.token in gone for a in attempts)
        for execution in tuple(self._executions):
            # What has finished meanwhile is delivered: nobody has to execute it again.
            if execution.attempt.lease.token in gone and not execution.attempt.finished:
                self._drop(execution)

    def _drop(self, execution: Execution) -> None:
        self._log(f"{execution.attempt.lease.run}: no longer wanted here, stopped")
        execution.kill()
        self._executions.remove(execution)
        self._live.forget(execution.attempt.lease.run)
        execution.close()
        execution.attempt.discard()

    def _lease(self) -> None:
        free = self._backend.slots - len(self._executions)
        if free <= 0 or self._signals.drain:
            return
        finished = any(execution.attempt.finished for execution in self._executions)
        if self._overdue and (self._outbox or finished):
            # Nobody waits for these results any more: else their runs would be leased again here.
            return
        if time.monotonic() < max(self._lease_at, self._troubled_until):
            return
        shortage = self._paths.disk_shortage()
        if shortage:
            self._log(shortage)
            self._troubled_until = time.monotonic() + _RETRY_FAILED
            return
        request = LeaseRequest(self._busy(), free, tuple(self._missing_suts))
        reply = self._daemon.ask(LEASE, request)
        if len(reply.grants) < free:
            # The queue is empty: it is asked again when there is a hint, or in a while.
            self._lease_at = time.monotonic() + _POLL
        self._leased.extend(reply.grants)
        while self._leased:
            self._begin(self._leased[0])
            self._leased.popleft()

    def _begin(self, lease: Lease) -> None:
        attempt: Attempt | None = None
        try:
            attempt = self._spool.open(lease)
            scene = self._inputs.scene(lease.spec.scene)
            self._inputs.provide_files(attempt)
            self._executions.append(self._backend.start(attempt, scene, self._limits))
        except (DaemonError, OSError, EOFError, ValueError) as error:
            # No disk, no process, no scene: nothing the run could help.
            if attempt is not None:
                attempt.discard()
            self._log(f"{lease.run}: not started, {error}")
            me = self._info(0).id
            self._releases.append(
                ReleaseRequest(me, lease.run, lease.token, f"not started: {error}", blame=False)
            )
            self._troubled_until = time.monotonic() + _RETRY_FAILED

    def _give_up(self) -> None:
        for execution in self._executions:
            execution.kill("the worker was stopped")
            if execution.attempt.finished:
                self._outbox.append(execution.attempt)
            else:
                why = execution.end.why if execution.end is not None else ""
                self._give_back(execution.attempt, why, blame=False)
            execution.close()
        self._executions.clear()
        try:
            self._deliver()
        except Unreachable:
            self._log("left without telling the daemon: results stay in the spool")
