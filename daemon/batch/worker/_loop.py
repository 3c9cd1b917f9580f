"""The worker's loop: leases runs, has them executed, publishes their live views, delivers results.

One loop in one thread. It never holds the daemon's word for granted: whatever was not
acknowledged is asked, renewed or delivered again, across restarts of daemon and worker. A run is
watched while somebody subscribes to its own key; whoever executes it is told by a file in the
attempt's folder, and makes the details then only.
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
from daemon.batch.worker._attempts import Attempt, Backend, Execution, Spool
from daemon.batch.worker._connection import DaemonConnection, WorkerPaths
from daemon.batch.worker._inputs import FileCache, SceneCache
from daemon.batch.worker._signals import WorkerSignals
from daemon.batch.worker._uploader import ResultUploader
from daemon.model.execution import RunLimits
from daemon.model.messages import (
    LIVE,
    Lease,
    LeaseRef,
    LeaseRequest,
    ReleaseRequest,
    RenewRequest,
    WorkerInfo,
)
from daemon.model.verbs import LEASE, RELEASE, RENEW

_LIVE_PERIOD: Final = 0.2
"""Seconds between two words about a run to everybody, at least."""


@dataclass(slots=True)
class _WatchedRun:
    """One run under way: its own publisher, and whether its folder says that it is watched."""

    publisher: zenoh.Publisher
    folder: Path
    watched: bool = False
    said: float = 0.0


@dataclass(slots=True)
class LivePublisher:
    """Publishes what executions tell of themselves under the name of their ``worker``."""

    session: zenoh.Session
    worker: str
    _all: zenoh.Publisher = field(init=False)
    _runs: dict[str, _WatchedRun] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self._all = self._publisher(f"{LIVE}/{self.worker}")

    def _publisher(self, key: str) -> zenoh.Publisher:
        drop = zenoh.CongestionControl.DROP
        return self.session.declare_publisher(key, congestion_control=drop)

    def publish(self, execution: Execution) -> None:
        """Pass on what an execution last told, to those who want it."""
        live, execution.live = execution.live, b""
        if not live:
            return
        watch = self._watch(execution)
        now = time.monotonic()
        if watch.watched:
            watch.publisher.put(live)
        if now - watch.said >= _LIVE_PERIOD and _has_subscribers(self._all):
            watch.said = now
            self._all.put(live)

    def _watch(self, execution: Execution) -> _WatchedRun:
        run, folder = execution.attempt.grant.run, execution.attempt.folder
        watch = self._runs.get(run)
        if watch is None or watch.folder != folder:
            self.forget(run)
            key = f"{LIVE}/{self.worker}/{run}"
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
    """Whether anybody subscribes: the status itself, declared as bool, is always true."""
    return bool(publisher.matching_status.matching)  # type: ignore[attr-defined]


_POLL: Final = 1.0
_RETRY_UNREACHABLE: Final = 0.5
_DELIVERY_PAUSE: Final = 0.05
_RETRY_FAILED: Final = 3.0
_LEAVE_TIMEOUT: Final = 10.0
"""Seconds a leaving worker waits for a daemon that takes its results; then the spool has them.

Traces that are on their way go on.
"""


class WorkerLoop:
    """A worker's loop; :meth:`run` returns when its orders say so and its work is done."""

    def __init__(
        self,
        link: DaemonConnection,
        info: Callable[[int], WorkerInfo],
        base: WorkerPaths,
        spool: Spool,
        backend: Backend,
        orders: WorkerSignals,
        *,
        limits: RunLimits,
        renew: float,
        log: Callable[[str], None],
    ) -> None:
        self._link = link
        self._info = info
        self._places = base.places
        self._courier = ResultUploader(link, info(0).id, base, log)
        self._scenes = SceneCache(link, base)
        self._files = FileCache(link, base, self._renew)
        self._granted: deque[Lease] = deque()
        self._spool = spool
        self._backend = backend
        self._orders = orders
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
        self._lacks: dict[str, None] = {}
        self._watchers = LivePublisher(link.session, info(0).id)

    def run(self) -> None:
        """Work until told to leave, then finish or give back what is under way."""
        while not self._orders.abort:
            self._collect()
            self._talk()
            if self._orders.drain and not self._executions and self._may_leave():
                return
            self._rest()
        self._give_up()

    def _may_leave(self) -> bool:
        now = time.monotonic()
        if self._courier.moved != self._moved:
            self._moved, self._leave_by = self._courier.moved, 0.0
        self._leave_by = self._leave_by or now + _LEAVE_TIMEOUT
        return now > self._leave_by or not (self._outbox or self._releases)

    def _rest(self) -> None:
        now = time.monotonic()
        moments = [now + _POLL, max(self._renew_at, self._silent_until)]
        moments += [execution.deadline for execution in self._executions]
        if self._outbox or self._releases:
            moments.append(max(self._silent_until, self._deliver_at, now + _DELIVERY_PAUSE))
        pause = max(0.0, min(moments) - now)
        things: list[Any] = [self._orders.wake, *self._backend.waitables]
        for execution in self._executions:
            things += execution.waitables
        wait(things, max(pause, 0.001))
        if self._orders.take_hints():
            # Something came to the queue, or something that runs here is not wanted any more.
            self._lease_at = self._renew_at = 0.0

    def _collect(self) -> None:
        self._backend.listen()
        for execution in tuple(self._executions):
            execution.listen()
            self._watchers.publish(execution)
            if execution.ended:
                self._take_in(execution)

    def _take_in(self, execution: Execution) -> None:
        self._executions.remove(execution)
        self._watchers.forget(execution.attempt.grant.run)
        self._lease_at = 0.0
        execution.listen()
        if execution.attempt.finished:
            self._outbox.append(execution.attempt)
        elif execution.lacks:
            self._do_without(execution.attempt, execution.why())
        else:
            self._give_back(execution.attempt, execution.why(), blame=execution.blame)
        execution.close()

    def _do_without(self, attempt: Attempt, why: str) -> None:
        """Give a run back whose system under test is not installed here, and lease no such."""
        kind, me = attempt.grant.spec.sut.kind, self._info(0)
        self._lacks[kind] = None
        remedy = f'install what brings the system under test "{kind}" for worker {me.id}'
        self._give_back(attempt, f"{why}\n{remedy} on {me.host}, and start it again", blame=False)

    def _give_back(self, attempt: Attempt, why: str, *, blame: bool) -> None:
        grant = attempt.grant
        self._log(f"{grant.run} attempt {grant.attempt}: {why}")
        self._releases.append(ReleaseRequest(self._info(0).id, grant.run, grant.token, why, blame))
        attempt.discard()

    def _talk(self) -> None:
        if time.monotonic() < self._silent_until:
            return
        try:
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
                delivered = self._courier.hand_over(attempt)
            except (Refused, ValueError) as error:
                # Never to be taken: not a run of this ledger, or damaged in the spool.
                self._outbox.remove(attempt)
                self._give_back(attempt, f"the result was not taken: {error}", blame=True)
            except OSError as error:
                # A full disk, say: the spool keeps it.
                self._log(f"{attempt.grant.run}: delivered later, {error}")
                self._deliver_at = time.monotonic() + _RETRY_FAILED
            else:
                if not delivered:
                    return  # a large trace: other duties come in between
                self._outbox.remove(attempt)
                attempt.discard()

    def _release(self, release: ReleaseRequest) -> None:
        try:
            self._link.ask(RELEASE, release)
        except Refused as error:
            self._log(f"{release.run}: {error}")

    def _busy(self) -> WorkerInfo:
        return self._info(len(self._executions))

    def _renew(self) -> None:
        if time.monotonic() < self._renew_at:
            return
        self._outbox += self._spool.adopt()
        attempts = [execution.attempt for execution in self._executions] + self._outbox
        grants = [*(attempt.grant for attempt in attempts), *self._granted]
        holds = tuple(LeaseRef(grant.run, grant.token) for grant in grants)
        reply = self._link.ask(RENEW, RenewRequest(self._busy(), holds))
        self._renew_at = time.monotonic() + self._renew_period
        gone = {hold.token for hold in reply.gone}
        self._overdue = any(a.finished and a.grant.token in gone for a in attempts)
        for execution in tuple(self._executions):
            # What has finished meanwhile is delivered: nobody has to execute it again.
            if execution.attempt.grant.token in gone and not execution.attempt.finished:
                self._drop(execution)

    def _drop(self, execution: Execution) -> None:
        self._log(f"{execution.attempt.grant.run}: no longer wanted here, stopped")
        execution.kill()
        self._executions.remove(execution)
        self._watchers.forget(execution.attempt.grant.run)
        execution.close()
        execution.attempt.discard()

    def _lease(self) -> None:
        free = self._backend.slots - len(self._executions)
        if free <= 0 or self._orders.drain:
            return
        finished = any(execution.attempt.finished for execution in self._executions)
        if self._overdue and (self._outbox or finished):
            # Nobody waits for these results any more: else their runs would be leased again here.
            return
        if time.monotonic() < max(self._lease_at, self._troubled_until):
            return
        shortage = self._places.disk_shortage()
        if shortage:
            self._log(shortage)
            self._troubled_until = time.monotonic() + _RETRY_FAILED
            return
        reply = self._link.ask(LEASE, LeaseRequest(self._busy(), free, tuple(self._lacks)))
        if len(reply.grants) < free:
            self._lease_at = time.monotonic() + _POLL
        self._granted.extend(reply.grants)
        while self._granted:
            self._begin(self._granted[0])
            self._granted.popleft()

    def _begin(self, grant: Lease) -> None:
        attempt: Attempt | None = None
        try:
            attempt = self._spool.open(grant)
            scene = self._scenes.path(grant.spec.scene)
            self._files.lay_out(attempt)
            self._executions.append(self._backend.start(attempt, scene, self._limits))
        except (DaemonError, OSError, EOFError, ValueError) as error:
            # No disk, no process, no scene: nothing the run could help.
            if attempt is not None:
                attempt.discard()
            self._log(f"{grant.run}: not started, {error}")
            me = self._info(0).id
            self._releases.append(
                ReleaseRequest(me, grant.run, grant.token, f"not started: {error}", blame=False)
            )
            self._troubled_until = time.monotonic() + _RETRY_FAILED

    def _give_up(self) -> None:
        for execution in self._executions:
            execution.kill("the worker was stopped")
            if execution.attempt.finished:
                self._outbox.append(execution.attempt)
            else:
                self._give_back(execution.attempt, execution.why(), blame=False)
            execution.close()
        self._executions.clear()
        try:
            self._deliver()
        except Unreachable:
            self._log("left without telling the daemon: results stay in the spool")
