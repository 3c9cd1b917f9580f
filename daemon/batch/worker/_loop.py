"""The worker's loop: leases runs, has them executed, publishes their live views, delivers results.

One loop in one thread; what it asks of the daemon, threads carry there, except renewals. It never
takes the daemon's word for granted: whatever was not acknowledged is asked, renewed or delivered
again, across restarts of daemon and worker. A run is watched while somebody subscribes to its own
key; whoever executes it hears of that, and makes the details then only.

What becomes of a lease here:

    leased ──▶ executing ──▶ finished ──▶ delivered, forgotten
       │           ├───────▶ ended without a result: released, blamed or not
       │           └───────▶ not wanted any more (cancelled, another was first): stopped, forgotten
       └─ no disk, no process, no scene, or at work here already: released, not blamed

While the daemon cannot be reached everything goes on; afterwards it says what is still wanted.
Another ledger may answer in its place. Then what runs here ends and stays in the spool, and the
worker begins anew with that ledger.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Hashable
from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from multiprocessing.connection import wait
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from daemon.batch.errors import DaemonError, OtherLedger, Refused, Unavailable, Unreachable
from daemon.batch.worker._attempts import Attempt, AttemptEnd, Spool
from daemon.batch.worker._connection import (
    DaemonConnection,
    InputCache,
    InputDamaged,
    WorkerPaths,
)
from daemon.batch.worker._deliveries import Deliveries
from daemon.batch.worker._live import Execution, LivePublisher
from daemon.batch.worker._trouble import WorkerTrouble
from daemon.batch.worker._usage import UsageMeter
from daemon.batch.worker._wakeups import BackgroundAsks, WorkerSignals
from daemon.model.execution import RunLimits
from daemon.model.messages import (
    Lease,
    LeaseRef,
    LeaseReply,
    LeaseRequest,
    ReleaseRequest,
    RenewRequest,
    WorkerInfo,
)
from daemon.model.status import Preparation
from daemon.model.verbs import LEASE, RENEW

if TYPE_CHECKING:
    from daemon.batch.worker._dask import DaskPool
    from daemon.batch.worker._zygotes import ZygotePool

Backend: TypeAlias = "ZygotePool | DaskPool"
"""Starts executions, ``slots`` at a time; ``trouble`` says what keeps it from that, if that lasts.

A run that ``prepare`` returns ``False`` for is offered again. It and ``start`` raise
:class:`daemon.batch.errors.DaemonError` or ``OSError`` when a run cannot start now, which is
nothing to blame the run for.
"""
_POLL: Final = 1.0
"""Seconds between two requests for work: hints that there is some are sent once, unconfirmed."""
_RETRY_UNREACHABLE: Final = 0.5
"""Seconds to the next try when nobody answers: Zenoh itself connects again within 0.1 to 2 s."""
_LOOK_AT_DISK: Final = 3.0
"""Seconds between two looks whether a full disk has room again: that costs nothing."""
_LOOK_AT_LEDGER: Final = 2.0
"""Seconds between two looks whether the ledger has returned that granted what runs here."""
_LAST_WORDS: Final = 3.0
"""Seconds a worker that is ended takes to tell the daemon."""
_END_LIMIT: Final = 40.0
"""Seconds for runs that are ended with their worker: longer than it takes to give up the last."""
_MOST_LEASED: Final = 1024
"""Runs asked for at a time."""
_LEAVE_TIMEOUT: Final = 10.0
"""Seconds a leaving worker waits for a daemon that takes its results; then the spool has them.

Traces that are on their way go on.
"""
_MOST_UPLOADS: Final = 8
"""Traces under way at a time: each part must arrive in time over the line that they share."""
_LEASING: Final = "lease"


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
        # A renewal waits for the questions, and for no trace.
        self._asks, self._uploads = BackgroundAsks(), BackgroundAsks(_MOST_UPLOADS)
        # Of executing, and of delivering: each is over when that succeeds.
        self._trouble, undelivered = (WorkerTrouble(log, self._renew_soon) for _ in range(2))
        self._deliveries = Deliveries(
            daemon, paths, self._asks, self._uploads, spool, undelivered, info(0).id, log
        )
        self._inputs = InputCache(daemon, paths)
        # One thread: runs of a campaign share what comes. A renewal waits for none of it.
        self._fetches = BackgroundAsks(threads=1)
        self._fetched: dict[Hashable, Future[Any]] = {}
        # Leased, not started yet: scenes and files come, or kernels are compiled. Renewed like
        # those that run.
        self._leased: deque[Lease] = deque()
        self._spool = spool
        self._backend = backend
        self._signals = signals
        self._limits = limits
        self._renew_period = renew
        self._log = log
        self._executions: list[Execution] = []
        # Tokens of executions that are being ended because nobody wants them any more.
        self._unwanted: set[int] = set()
        self._renew_at = 0.0
        self._lease_at = 0.0
        self._wanted = 0
        self._silent_until = 0.0
        self._shortage = ""
        self._leave_by = 0.0
        self._moved = 0
        self._refusal = ""
        self._elsewhere = False
        self._preparation: Preparation | None = None
        # Kinds of systems under test that are not installed here: no run of them is leased again.
        self._missing_suts: dict[str, str] = {}
        self._meter = UsageMeter()
        self._live = LivePublisher(daemon.session, info(0).id, daemon.name)

    def run(self) -> bool:
        """Work until told to leave, then finish or give back what is under way.

        Returns whether it ended because another ledger answers instead, of which it has nothing.
        """
        try:
            while not self._signals.abort:
                self._collect_results()
                self._start_leased()
                self._talk_to_daemon()
                if self._signals.drain and not self._executions and self._may_leave():
                    return False
                if self._elsewhere and not self._executions:
                    return True
                self._wait()
            self._give_up()
            return False
        finally:
            for asks in (self._asks, self._uploads, self._fetches):
                asks.close()

    def _may_leave(self) -> bool:
        # Results that nobody takes do not keep a worker for ever: the spool keeps them. The limit
        # begins anew whenever something of a trace arrives.
        now = time.monotonic()
        if self._deliveries.moved != self._moved:
            self._moved, self._leave_by = self._deliveries.moved, 0.0
        self._leave_by = self._leave_by or now + _LEAVE_TIMEOUT
        # An answer under way may grant runs: they are given back before it leaves.
        owed = self._deliveries.pending or self._leased or len(self._asks)
        return now > self._leave_by or not owed

    def _wait(self) -> None:
        now = time.monotonic()
        moments = [now + _POLL, max(self._renew_at, self._silent_until)]
        moments += [execution.deadline for execution in self._executions]
        troubles = (self._trouble, self._deliveries.trouble)
        moments += [trouble.until for trouble in troubles if trouble.until > now]
        if len(self._asks) and self._renew_at <= now:
            # The renewal waits for the answers under way, and those wake this loop.
            moments = [moment for moment in moments if moment > now] or [now + _POLL]
        pause = max(0.0, min(moments) - now)
        asks = (self._asks, self._uploads, self._fetches)
        receivers = [self._signals.receiver, *(one.receiver for one in asks)]
        things: list[Any] = [*receivers, *self._backend.waitables]
        for execution in self._executions:
            things += execution.waitables
        wait(things, max(pause, 0.001))  # 0 would spin while a deadline passes
        if self._signals.take_wakeups():
            # Something came to the queue, or something that runs here is not wanted any more.
            self._lease_at = self._renew_at = 0.0

    def _collect_results(self) -> None:
        self._backend.listen()
        if self._backend.preparation != self._preparation:
            self._preparation = self._backend.preparation
            self._renew_soon()
        for execution in tuple(self._executions):
            execution.listen()
            self._live.publish(execution)
            if execution.end is not None:
                self._take_ended(execution)

    def _take_ended(self, execution: Execution) -> None:
        self._executions.remove(execution)
        self._lease_at = 0.0
        self._live.forget(execution.attempt.lease.run)
        attempt, end = execution.attempt, execution.end or AttemptEnd()
        unwanted = attempt.lease.token in self._unwanted
        self._unwanted.discard(attempt.lease.token)
        if attempt.finished:
            self._trouble.clear()
            self._deliveries.finished.append(attempt)
        elif unwanted:
            self._spool.discard(attempt)
        elif end.sut_missing:
            self._give_back_missing_sut(attempt, end.why)
        else:
            if not end.counts:
                self._trouble.note(end.why)
            blame = end.counts and not self._signals.abort
            self._deliveries.give_back_attempt(attempt, end.why, blame=blame)
        execution.close()

    def _renew_soon(self) -> None:
        """Tell the daemon what has changed about this worker."""
        self._renew_at = 0.0

    def _give_back_missing_sut(self, attempt: Attempt, why: str) -> None:
        """Give a run back whose system under test is not installed here, and lease no such."""
        kind, me = attempt.lease.spec.sut.kind, self._info(0)
        remedy = f'install what brings the system under test "{kind}" for worker {me.id}'
        self._missing_suts[kind] = f"{remedy} on {me.host}, and start it again"
        words = f"{why}\n{remedy} on {me.host}, and start it again"
        self._deliveries.give_back_attempt(attempt, words, blame=False)

    def _talk_to_daemon(self) -> None:
        self._take_answers()
        if time.monotonic() < self._silent_until:
            return
        self._deliveries.send_releases()
        try:
            if time.monotonic() >= self._renew_at:
                # A renewal lists all that is held here: a run that is being granted meanwhile would
                # not be on the list and taken back, one whose result is being taken would be on it
                # and gone. So it goes alone, and nothing new is asked until it has gone.
                self._deliveries.adopt(self._spool.adopt())
                if len(self._asks) or self._deliveries.releases:
                    return
                self._renew()
        except OtherLedger as error:
            self._leave_ledger(error)
            return
        except (Unavailable, Refused) as error:
            # The daemon is there: it may take results all the same.
            self._log_refusal(error)
            self._renew_at = time.monotonic() + _POLL
            self._lease_at = max(self._lease_at, self._renew_at + _POLL)
        except Unreachable as error:
            self._not_answered(error)
            return
        # In this order: leases that are old are renewed before new ones are asked for.
        self._deliver()
        self._lease()

    def _take_answers(self) -> None:
        for key, answer in (*self._asks.take(), *self._uploads.take()):
            try:
                if key == _LEASING:
                    self._take_grants(answer.result())
                elif isinstance(key, ReleaseRequest):
                    self._deliveries.take_release_answer(key, answer)
                elif isinstance(key, Path):
                    self._deliveries.take_result_answer(key, answer)
            except (Unreachable, Refused) as error:
                self._not_answered(error)

    def _leave_ledger(self, error: OtherLedger) -> None:
        """Begin and deliver nothing more: another ledger answers."""
        self._log_refusal(error)
        self._elsewhere = True
        self._leased.clear()
        self._silent_until = self._renew_at = time.monotonic() + _LOOK_AT_LEDGER

    def _not_answered(self, error: DaemonError) -> None:
        if isinstance(error, OtherLedger):
            self._leave_ledger(error)
            return
        self._log_refusal(error)
        if isinstance(error, Unreachable) and not isinstance(error, Unavailable):
            self._silent_until = time.monotonic() + _RETRY_UNREACHABLE
            self._renew_at = 0.0  # a new daemon hears first what runs here
            return
        self._silent_until = time.monotonic() + _POLL

    def _log_refusal(self, error: DaemonError) -> None:
        if str(error) != self._refusal:  # it is asked again every second, and says the same
            self._log(f"the daemon refused: {error}" if isinstance(error, Refused) else str(error))
        self._refusal = str(error)

    def _deliver(self) -> None:
        if time.monotonic() >= self._deliveries.trouble.until:
            self._deliveries.send_results()

    def _busy(self) -> WorkerInfo:
        # The backend's before that of the runs: it is their cause.
        causes = (self._shortage, self._backend.trouble)
        words = (*causes, self._trouble.words, self._deliveries.trouble.words)
        trouble = next(filter(None, (*words, *self._missing_suts.values())), "")
        # A run that is leased and waits for machine code has a slot as well.
        held = len(self._executions) + len(self._leased)
        info = self._info(min(held, max(self._backend.slots, len(self._executions))))
        usage = self._meter.measure()
        return replace(
            info,
            trouble=trouble,
            preparation=self._preparation,
            notice=self._deliveries.foreign_words,
            cpu=usage.cpu,
            memory=usage.memory,
            memory_total=usage.memory_total,
            progress=self._live.progress(),
        )

    def _wanted_executions(self) -> list[Execution]:
        """Executions that are not being ended because nobody wants them any more."""
        return [one for one in self._executions if one.attempt.lease.token not in self._unwanted]

    def _renew(self) -> None:
        running = [execution.attempt for execution in self._wanted_executions()]
        attempts = running + self._deliveries.finished
        leases = [*(attempt.lease for attempt in attempts), *self._leased]
        holds = tuple(LeaseRef(lease.run, lease.token) for lease in leases)
        reply = self._daemon.ask(RENEW, RenewRequest(self._busy(), holds))
        self._renew_at = time.monotonic() + self._renew_period
        if self._elsewhere:
            self._elsewhere = False
            self._deliveries.offer_again()
        gone = {hold.token for hold in reply.gone}
        self._leased = deque(lease for lease in self._leased if lease.token not in gone)
        for execution in self._executions:
            lease = execution.attempt.lease
            # What has finished meanwhile is delivered: the daemon says what it thinks of it.
            if lease.token in gone and not execution.attempt.finished:
                self._log(f"{lease.run}: no longer wanted here, stopped")
                self._unwanted.add(lease.token)
                execution.kill()

    def _lease(self) -> None:
        slots = self._backend.slots
        held = len(self._executions) + len(self._leased)
        wanted = min(slots - held, _MOST_LEASED)
        if slots <= 0 or wanted <= 0 or self._signals.drain or _LEASING in self._asks:
            return
        pauses = (self._trouble.until, self._deliveries.trouble.until)
        if time.monotonic() < max(self._lease_at, *pauses):
            return
        if self._is_disk_short():
            self._lease_at = time.monotonic() + _LOOK_AT_DISK
            return
        if self._trouble.words or self._deliveries.trouble.words:
            # One run tries whether it is over.
            if held:
                return
            wanted = 1
        request = LeaseRequest(self._busy(), wanted, tuple(self._missing_suts))
        self._wanted = wanted
        # Until a hint, or for a while, unless it brings as many as were wanted.
        self._lease_at = time.monotonic() + _POLL
        self._asks.start(_LEASING, partial(self._daemon.ask, LEASE, request))

    def _is_disk_short(self) -> bool:
        before, self._shortage = self._shortage, self._paths.disk_shortage()
        if self._shortage != before:
            self._log(self._shortage or "the disk has room again")
            self._renew_soon()
        return bool(self._shortage)

    def _take_grants(self, reply: LeaseReply) -> None:
        self._refusal = ""
        leases = [execution.attempt.lease for execution in self._wanted_executions()]
        held = {lease.run for lease in (*leases, *self._leased)}
        for lease in reply.grants:
            if lease.run not in held:
                self._leased.append(lease)
                continue
            # The lease held here has lapsed unnoticed, in a suspended machine for example. Once
            # this one is given back, a renewal takes the run up again under the old lease.
            self._deliveries.give_back(lease, "its worker is still at it")
            self._renew_soon()
        if len(reply.grants) == self._wanted:
            self._lease_at = 0.0
        # Before anybody is heard who wants this worker to leave: these count as running.
        self._fill_slots()

    def _start_leased(self) -> None:
        # A worker that leaves, or is in trouble, keeps no run from others that it has not begun.
        troubled = self._trouble.words and len(self._leased) > 1
        if self._leased and (self._signals.drain or troubled):
            for lease in self._leased:
                self._deliveries.give_back(lease, "" if troubled else "the worker was stopped")
            self._leased.clear()
        self._fill_slots()

    def _fill_slots(self) -> None:
        slots = 0 if self._signals.abort else self._backend.slots
        held = {lease.token for lease in self._leased}
        self._fetched |= {token: answer for token, answer in self._fetches.take() if token in held}
        for lease in tuple(self._leased):
            if len(self._executions) >= slots:
                return
            # One whose kernels are compiled, or whose files come, keeps no other from its slot:
            # this loop is woken when they are there.
            if self._begin(lease):
                self._leased.remove(lease)

    def _has_inputs(self, lease: Lease) -> bool:
        """Whether all that a run needs lies here; sees to it otherwise, and is asked again.

        Raises as :meth:`InputCache.provide` does.
        """
        answer = self._fetched.pop(lease.token, None)
        if answer is not None:
            answer.result()
            return True
        if not self._inputs.lacks(lease.spec):
            return True
        if lease.token not in self._fetches:
            self._fetches.start(lease.token, partial(self._inputs.fetch, lease.spec))
        return False

    def _begin(self, lease: Lease) -> bool:
        """Start a run, or give it back; returns ``False`` while something it needs is not ready."""
        attempt: Attempt | None = None
        try:
            if not self._has_inputs(lease):
                return False
            if not self._backend.prepare(lease.spec, self._inputs.scene(lease.spec), self._limits):
                return False
            attempt = self._spool.open(lease)
            scene = self._inputs.provide(attempt)
            self._executions.append(self._backend.start(attempt, scene, self._limits))
        except (DaemonError, OSError, ValueError) as error:
            # No disk, no process, no scene: nothing the run could help.
            if attempt is not None:
                self._spool.discard(attempt)
            self._log(f"{lease.run}: not started, {error}")
            words = f"not started: {error}"
            damaged = error.digest if isinstance(error, InputDamaged) else ""
            self._deliveries.give_back(lease, words, damaged=damaged)
            self._trouble.note(words)
        return True

    def _give_up(self) -> None:
        for execution in self._executions:
            execution.kill("the worker was stopped")
        self._renew_at, deadline = math.inf, time.monotonic() + _END_LIMIT
        while self._executions and time.monotonic() < deadline:
            self._wait()
            self._collect_results()
        deadline = time.monotonic() + _LAST_WORDS
        self._asks.wait(_LAST_WORDS)  # runs may be on their way here
        self._take_answers()
        self._start_leased()  # gives them back
        self._silent_until = 0.0
        while self._deliveries.pending or _LEASING in self._asks:
            self._deliveries.send_releases()
            self._deliver()
            remaining = max(0.0, deadline - time.monotonic())
            wait([self._asks.receiver, self._uploads.receiver], remaining)
            self._take_answers()
            if self._deliveries.trouble.words or self._silent_until or time.monotonic() > deadline:
                self._log("left without telling the daemon all: results stay in the spool")
                return
