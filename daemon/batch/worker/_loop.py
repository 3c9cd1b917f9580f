"""The worker's loop: leases runs, executes them, publishes their live views, delivers results.

One loop in one thread; other threads send its requests, except renewals. It repeats every request,
renewal and delivery without an acknowledgement, across restarts of daemon and worker. A run is
watched while somebody subscribes to its own key; only then its process makes the details.

States of a lease here:

    leased ──▶ executing ──▶ finished ──▶ delivered, forgotten
       │           ├───────▶ ended without a result: released, blamed or not
       │           └───────▶ abandoned (cancelled, another was first): stopped, forgotten
       └─ no disk, no process, no scene, or at work here already: released, not blamed

Without the daemon everything goes on; the next renewal tells which runs to stop. If another ledger
answers, runs here end and stay in the spool, and the worker begins anew with that ledger.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Hashable
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from functools import partial
from multiprocessing.connection import wait
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import psutil

from daemon.batch.errors import DaemonError, OtherLedger, Refused, Unavailable, Unreachable
from daemon.batch.worker._attempts import Attempt, AttemptEnd, Spool, log
from daemon.batch.worker._connection import DaemonConnection, InputCache, InputDamaged, WorkerPaths
from daemon.batch.worker._deliveries import Deliveries, WorkerTrouble
from daemon.batch.worker._live import Execution, LivePublisher
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
"""Starts executions, ``slots`` at a time; ``trouble`` is a lasting reason why it cannot.

Call ``prepare`` again for a run while it returns ``False``. It and ``start`` raise
:class:`daemon.batch.errors.DaemonError` or ``OSError`` when a run cannot start now, which is not
the run's fault.
"""
_POLL: Final = 1.0
"""Period of requests for work [s]: the hints for new runs may be lost."""
_RETRY_UNREACHABLE: Final = 0.5
"""Pause after a request without an answer [s]: Zenoh reconnects within 0.1 to 2 s."""
_LOOK_AT_DISK: Final = 3.0
"""Period of checks of a full disk [s]."""
_LOOK_AT_LEDGER: Final = 2.0
"""Period of checks for the return of the ledger whose leases run here [s]."""
_LAST_WORDS: Final = 3.0
"""Time of an aborted worker for its last messages to the daemon [s]."""
_END_LIMIT: Final = 40.0
"""Time for the end of an aborted worker's runs [s], enough to give up the last one."""
_MOST_LEASED: Final = 1024
"""Most runs in one request."""
_LEAVE_TIMEOUT: Final = 10.0
"""Time for which a stopping worker waits for the acceptance of its results [s].

It begins anew with each part of a trace. Then the results stay in the spool.
"""
_MOST_UPLOADS: Final = 8
"""Most uploads at a time: each part must arrive in time over the shared line."""
_LEASING: Final = "lease"
_USAGE_PERIOD: Final = 1.0
"""Period of measurements of usage [s]: one costs about a millisecond for each process."""


class WorkerLoop:
    """A worker's loop; :meth:`run` returns after a stop signal, when its work is done."""

    def __init__(
        self,
        daemon: DaemonConnection,
        me: WorkerInfo,
        paths: WorkerPaths,
        spool: Spool,
        backend: Backend,
        signals: WorkerSignals,
        *,
        limits: RunLimits,
        renew: float,
    ) -> None:
        self._daemon = daemon
        self._me = me
        self._paths = paths.state
        # A renewal waits for the requests, but not for traces.
        self._asks, self._uploads = BackgroundAsks(), BackgroundAsks(_MOST_UPLOADS)
        # Troubles of executing and of delivering: each ends with a success.
        self._trouble, undelivered = (WorkerTrouble(self._renew_soon) for _ in range(2))
        self._deliveries = Deliveries(
            daemon, paths, self._asks, self._uploads, spool, undelivered, me.id
        )
        self._inputs = InputCache(daemon, paths)
        # One thread: runs of a campaign share their inputs. Renewals do not wait for it.
        self._fetches = BackgroundAsks(threads=1)
        self._fetched: dict[Hashable, Future[Any]] = {}
        # Leased but not started, while inputs arrive or kernels are compiled. Renewed like running
        # ones.
        self._leased: deque[Lease] = deque()
        self._spool = spool
        self._backend = backend
        self._signals = signals
        self._limits = limits
        self._renew_period = renew
        self._executions: list[Execution] = []
        # Tokens of executions that are being ended because the ledger has dropped their leases.
        self._abandoned: set[int] = set()
        self._renew_at = 0.0
        self._lease_at = 0.0
        self._requested = 0
        self._silent_until = 0.0
        self._shortage = ""
        self._leave_by = 0.0
        self._moved = 0
        self._refusal = ""
        self._elsewhere = False
        self._preparation: Preparation | None = None
        # Remedies by kind of system under test that is not installed here, and never leased again.
        self._missing_suts: dict[str, str] = {}
        self._meter = UsageMeter()
        self._live = LivePublisher(daemon.session, me.id, daemon.name)

    def run(self) -> bool:
        """Work until a stop signal, then finish or return the runs.

        Return whether it ended because another ledger answers.
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
        # A worker does not wait forever for the acceptance of results: the spool keeps them. The
        # limit begins anew with each part of a trace.
        now = time.monotonic()
        if self._deliveries.moved != self._moved:
            self._moved, self._leave_by = self._deliveries.moved, 0.0
        self._leave_by = self._leave_by or now + _LEAVE_TIMEOUT
        # A pending answer may grant runs, which must be returned first.
        has_work = self._deliveries.pending or self._leased or len(self._asks)
        return now > self._leave_by or not has_work

    def _wait(self) -> None:
        now = time.monotonic()
        moments = [now + _POLL, max(self._renew_at, self._silent_until)]
        moments += [execution.deadline for execution in self._executions]
        troubles = (self._trouble, self._deliveries.trouble)
        moments += [trouble.until for trouble in troubles if trouble.until > now]
        if len(self._asks) and self._renew_at <= now:
            # The renewal waits for pending answers, which wake this loop.
            moments = [moment for moment in moments if moment > now] or [now + _POLL]
        pause = max(0.0, min(moments) - now)
        asks = (self._asks, self._uploads, self._fetches)
        receivers = [self._signals.receiver, *(one.receiver for one in asks)]
        things: list[Any] = [*receivers, *self._backend.waitables]
        for execution in self._executions:
            things += execution.waitables
        wait(things, max(pause, 0.001))  # 0 would spin while a deadline passes
        if self._signals.take_wakeups():
            # There are new runs, or a run here was cancelled.
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
        is_abandoned = attempt.lease.token in self._abandoned
        self._abandoned.discard(attempt.lease.token)
        if attempt.finished:
            self._trouble.clear()
            self._deliveries.finished.append(attempt)
        elif is_abandoned:
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
        """Send the daemon a change of this worker soon."""
        self._renew_at = 0.0

    def _give_back_missing_sut(self, attempt: Attempt, why: str) -> None:
        """Return a run whose system under test is not installed here, and lease no more such."""
        kind, me = attempt.lease.spec.sut.kind, self._me
        remedy = f'install the system under test "{kind}" for worker {me.id} on {me.host}'
        self._missing_suts[kind] = f"{remedy}, and start it again"
        words = f"{why}\n{self._missing_suts[kind]}"
        self._deliveries.give_back_attempt(attempt, words, blame=False)

    def _talk_to_daemon(self) -> None:
        self._take_answers()
        if time.monotonic() < self._silent_until:
            return
        self._deliveries.send_releases()
        try:
            if time.monotonic() >= self._renew_at:
                # A renewal lists all leases here. A run granted in a pending answer would be absent
                # and taken back; one whose result is being recorded would be listed and dropped. So
                # a renewal waits for all answers, and blocks new requests.
                self._deliveries.adopt()
                if len(self._asks) or self._deliveries.releases:
                    return
                self._renew()
        except OtherLedger as error:
            self._leave_ledger(error)
            return
        except (Unavailable, Refused) as error:
            # The daemon is there: it may still accept results.
            self._log_refusal(error)
            self._renew_at = time.monotonic() + _POLL
            self._lease_at = max(self._lease_at, self._renew_at + _POLL)
        except Unreachable as error:
            self._not_answered(error)
            return
        # In this order: renew old leases before asking for new ones.
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
        """Stop starting and delivering runs: another ledger answers."""
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
            self._renew_at = 0.0  # renew first: it may be a new daemon
            return
        self._silent_until = time.monotonic() + _POLL

    def _log_refusal(self, error: DaemonError) -> None:
        if str(error) != self._refusal:  # the same answer comes every second
            log(f"the daemon refused: {error}" if isinstance(error, Refused) else str(error))
        self._refusal = str(error)

    def _deliver(self) -> None:
        if time.monotonic() >= self._deliveries.trouble.until:
            self._deliveries.send_results()

    def _busy(self) -> WorkerInfo:
        # The backend's trouble before that of the runs: it is their cause.
        causes = (self._shortage, self._backend.trouble)
        words = (*causes, self._trouble.words, self._deliveries.trouble.words)
        trouble = next(filter(None, (*words, *self._missing_suts.values())), "")
        # A leased run that waits for its kernels also takes a slot.
        count = len(self._executions) + len(self._leased)
        slots = self._backend.slots
        info = replace(
            self._me,
            slots=slots,
            busy=min(count, max(slots, len(self._executions))),
            trouble=trouble,
            preparation=self._preparation,
            notice=self._deliveries.foreign_words,
            progress=self._live.progress(),
        )
        return self._meter.measure(info)

    def _current_executions(self) -> list[Execution]:
        """Return the executions that are not abandoned."""
        return [one for one in self._executions if one.attempt.lease.token not in self._abandoned]

    def _renew(self) -> None:
        running = [execution.attempt for execution in self._current_executions()]
        attempts = running + self._deliveries.finished
        leases = [*(attempt.lease for attempt in attempts), *self._leased]
        holds = tuple(LeaseRef(lease.run, lease.token) for lease in leases)
        reply = self._daemon.ask(RENEW, RenewRequest(self._busy(), holds))
        self._renew_at = time.monotonic() + self._renew_period
        if self._elsewhere:
            self._elsewhere = False
            self._deliveries.offer_again()
        dropped = {hold.token for hold in reply.gone}
        self._leased = deque(lease for lease in self._leased if lease.token not in dropped)
        for execution in self._executions:
            lease = execution.attempt.lease
            # A run that has finished is delivered all the same: the daemon decides about it.
            if lease.token in dropped and not execution.attempt.finished:
                log(f"{lease.run}: no longer wanted here, stopped")
                self._abandoned.add(lease.token)
                execution.kill()

    def _lease(self) -> None:
        slots = self._backend.slots
        busy = len(self._executions) + len(self._leased)
        count = min(slots - busy, _MOST_LEASED)
        if slots <= 0 or count <= 0 or self._signals.drain or _LEASING in self._asks:
            return
        pauses = (self._trouble.until, self._deliveries.trouble.until)
        if time.monotonic() < max(self._lease_at, *pauses):
            return
        if self._is_disk_short():
            self._lease_at = time.monotonic() + _LOOK_AT_DISK
            return
        if self._trouble.words or self._deliveries.trouble.words:
            # Test with one run whether it is over.
            if busy:
                return
            count = 1
        request = LeaseRequest(self._busy(), count, tuple(self._missing_suts))
        self._requested = count
        # The next request waits for a hint or a while, unless this one is fully granted.
        self._lease_at = time.monotonic() + _POLL
        self._asks.start(_LEASING, partial(self._daemon.ask, LEASE, request))

    def _is_disk_short(self) -> bool:
        previous, self._shortage = self._shortage, self._paths.disk_shortage()
        if self._shortage != previous:
            log(self._shortage or "the disk has space again")
            self._renew_soon()
        return bool(self._shortage)

    def _take_grants(self, reply: LeaseReply) -> None:
        self._refusal = ""
        leases = [execution.attempt.lease for execution in self._current_executions()]
        runs = {lease.run for lease in (*leases, *self._leased)}
        for lease in reply.grants:
            if lease.run not in runs:
                self._leased.append(lease)
                continue
            # The old lease has lapsed unnoticed, as in a suspended machine. After the return of the
            # new one, a renewal restores the old one.
            self._deliveries.give_back(lease, "its worker is still at it")
            self._renew_soon()
        if len(reply.grants) == self._requested:
            self._lease_at = 0.0
        # Before the next stop signal is handled, so that these count as running.
        self._fill_slots()

    def _start_leased(self) -> None:
        # A worker that stops or is in trouble returns runs that have not begun.
        in_trouble = self._trouble.words and len(self._leased) > 1
        if self._leased and (self._signals.drain or in_trouble):
            for lease in self._leased:
                self._deliveries.give_back(lease, "" if in_trouble else "the worker was stopped")
            self._leased.clear()
        self._fill_slots()

    def _fill_slots(self) -> None:
        slots = 0 if self._signals.abort else self._backend.slots
        tokens = {lease.token for lease in self._leased}
        self._fetched |= {token: fetch for token, fetch in self._fetches.take() if token in tokens}
        for lease in tuple(self._leased):
            if len(self._executions) >= slots:
                return
            # A run that waits for kernels or files does not block others: their arrival wakes this
            # loop.
            if self._begin(lease):
                self._leased.remove(lease)

    def _has_inputs(self, lease: Lease) -> bool:
        """Return whether all inputs of a run are here; otherwise fetch them.

        Raises as :meth:`InputCache.provide`.
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
        """Start a run, or return it after an error; return ``False`` while it is not ready."""
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
            # No disk, no process, no scene: not the run's fault.
            if attempt is not None:
                self._spool.discard(attempt)
            log(f"{lease.run}: not started, {error}")
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
        self._asks.wait(_LAST_WORDS)  # a pending answer may grant runs
        self._take_answers()
        self._start_leased()  # returns them
        self._silent_until = 0.0
        while self._deliveries.pending or _LEASING in self._asks:
            self._deliveries.send_releases()
            self._deliver()
            remaining = max(0.0, deadline - time.monotonic())
            wait([self._asks.receiver, self._uploads.receiver], remaining)
            self._take_answers()
            if self._deliveries.trouble.words or self._silent_until or time.monotonic() > deadline:
                log("stopped with undelivered results, which stay in the spool")
                return


class UsageMeter:
    """Measures this process and its descendants, at most once a second."""

    def __init__(self) -> None:
        self._process = psutil.Process()
        self._cores = psutil.cpu_count() or 1
        self._total = psutil.virtual_memory().total
        self._measured_at, self._cpu = time.monotonic(), 0.0
        self._seconds, self._memory = self._look()

    def measure(self, info: WorkerInfo) -> WorkerInfo:
        """Add the usage since the last measurement, or the last one if that is recent."""
        passed = time.monotonic() - self._measured_at
        if passed >= _USAGE_PERIOD:
            previous = self._seconds
            self._seconds, self._memory = self._look()
            cpu = (self._seconds - previous) / (passed * self._cores)
            self._cpu = min(1.0, max(0.0, cpu))
            self._measured_at += passed
        return replace(info, cpu=self._cpu, memory=self._memory, memory_total=self._total)

    def _look(self) -> tuple[float, int]:
        """Return the processor time so far [s] and the memory [B]."""
        seconds, memory = 0.0, 0
        for process in (self._process, *self._process.children(recursive=True)):
            with suppress(psutil.Error):  # it may just have ended
                # Ended children count with the parent that has waited for them.
                seconds += sum(process.cpu_times()[:4])
                # Runs are forked from one process: resident sizes would count shared pages often.
                memory += process.memory_full_info().pss
        return seconds, memory
