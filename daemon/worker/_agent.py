"""The agent: leases runs, has them executed, delivers what they leave.

One loop in one thread. It never holds the daemon's word for granted: whatever was not
acknowledged is asked, renewed or delivered again, across restarts of daemon and worker.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import wait
from typing import Any, Final, TypeVar

import zenoh

from daemon import bus
from daemon.errors import DaemonError, Refused, Unreachable
from daemon.executor import Limits
from daemon.messages import (
    Acknowledgement,
    Grant,
    Hold,
    LeaseReply,
    LeaseRequest,
    Release,
    RenewReply,
    RenewRequest,
    Verb,
    WorkerInfo,
)
from daemon.security import Holder
from daemon.worker._backend import Backend, Execution
from daemon.worker._base import Base
from daemon.worker._delivery import Courier
from daemon.worker._files import Files
from daemon.worker._scenes import Scenes
from daemon.worker._signals import Orders
from daemon.worker._spool import Attempt, Spool
from daemon.worker._watch import Watchers

T = TypeVar("T")

_TIMEOUT: Final = 5.0
_POLL: Final = 1.0
_AFTER_SILENCE: Final = 0.5
_BREATH: Final = 0.05
_AFTER_FAILURE: Final = 3.0
_FAREWELL: Final = 10.0
"""Seconds a leaving worker waits for a daemon that takes its results; then the spool has them.

Traces that are on their way go on.
"""


@dataclass(frozen=True, slots=True)
class Link:
    """The connection to the daemon."""

    session: zenoh.Session
    endpoint: str
    holder: Holder | None = None

    def ask(self, verb: Verb, request: object, kind: type[T]) -> T:
        """Ask the daemon; raises :class:`Unreachable` or :class:`Refused`."""
        return bus.ask(self.session, self.endpoint, verb, request, kind, _TIMEOUT, self.holder)


class Agent:
    """A worker's loop; :meth:`run` returns when its orders say so and its work is done."""

    def __init__(
        self,
        link: Link,
        info: Callable[[int], WorkerInfo],
        base: Base,
        spool: Spool,
        backend: Backend,
        orders: Orders,
        *,
        limits: Limits,
        renew: float,
        log: Callable[[str], None],
    ) -> None:
        self._link = link
        self._info = info
        self._places = base.places
        self._courier = Courier(link, info(0).id, base, log)
        self._scenes = Scenes(link, base)
        self._files = Files(link, base, self._renew)
        self._granted: deque[Grant] = deque()
        self._spool = spool
        self._backend = backend
        self._orders = orders
        self._limits = limits
        self._renew_period = renew
        self._log = log
        self._executions: list[Execution] = []
        self._outbox: list[Attempt] = []
        self._releases: list[Release] = []
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
        self._watchers = Watchers(link.session, info(0).id)

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
        self._leave_by = self._leave_by or now + _FAREWELL
        return now > self._leave_by or not (self._outbox or self._releases)

    def _rest(self) -> None:
        now = time.monotonic()
        moments = [now + _POLL, max(self._renew_at, self._silent_until)]
        moments += [execution.deadline for execution in self._executions]
        if self._outbox or self._releases:
            moments.append(max(self._silent_until, self._deliver_at, now + _BREATH))
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
        self._releases.append(Release(self._info(0).id, grant.run, grant.token, why, blame))
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
            self._silent_until = time.monotonic() + _AFTER_SILENCE
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
                self._deliver_at = time.monotonic() + _AFTER_FAILURE
            else:
                if not delivered:
                    return  # a large trace: other duties come in between
                self._outbox.remove(attempt)
                attempt.discard()

    def _release(self, release: Release) -> None:
        try:
            self._link.ask(Verb.RELEASE, release, Acknowledgement)
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
        holds = tuple(Hold(grant.run, grant.token) for grant in grants)
        reply = self._link.ask(Verb.RENEW, RenewRequest(self._busy(), holds), RenewReply)
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
        shortage = self._places.shortage()
        if shortage:
            self._log(shortage)
            self._troubled_until = time.monotonic() + _AFTER_FAILURE
            return
        reply = self._link.ask(
            Verb.LEASE, LeaseRequest(self._busy(), free, tuple(self._lacks)), LeaseReply
        )
        if len(reply.grants) < free:
            self._lease_at = time.monotonic() + _POLL
        self._granted.extend(reply.grants)
        while self._granted:
            self._begin(self._granted[0])
            self._granted.popleft()

    def _begin(self, grant: Grant) -> None:
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
                Release(me, grant.run, grant.token, f"not started: {error}", blame=False)
            )
            self._troubled_until = time.monotonic() + _AFTER_FAILURE

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
