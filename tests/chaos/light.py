"""Workers that execute nothing: they lease and complete through real sessions, many a second."""

import threading
import time
from dataclasses import replace
from functools import partial
from importlib.metadata import version

from daemon.batch import bus
from daemon.batch.errors import Refused, Unreachable
from daemon.batch.paths import StatePaths
from daemon.model import verbs
from daemon.model.messages import (
    ALIVE,
    Completion,
    LeaseRef,
    LeaseRequest,
    LedgerAnswer,
    RenewRequest,
    WorkerInfo,
)
from tests.make import make_result


class LightWorker:
    """A worker by what it says on the bus, the owner's or one with a ``key``.

    With ``places`` it leaves an empty trace there.
    """

    def __init__(self, session, endpoint, name, slots=8, places=None, key=None, timeout=5.0):
        self.name = name
        self._ask = partial(bus.ask, session, endpoint, timeout=timeout, credentials=key)
        self._info = WorkerInfo(name, "here", 1, version("scenario-tui"), slots, 0)
        self._slots = slots
        self._places = places
        self._token = session.liveliness().declare_token(f"{ALIVE}/{bus.key_name(key)}/{name}")

    def me(self):
        if not self._info.era:
            reply = self._ask(verbs.WELCOME, self._info)
            self._info = replace(self._info, era=reply.era)
        return self._info

    def lease(self, count=None):
        """Take runs; raises like :func:`daemon.batch.bus.ask`."""
        request = LeaseRequest(self.me(), self._slots if count is None else count)
        return self._ask(verbs.LEASE, request).grants

    def renew(self, grants=()):
        """Say which runs it has; returns how many are not its own any more."""
        holds = tuple(LeaseRef(grant.run, grant.token) for grant in grants)
        return len(self._ask(verbs.RENEW, RenewRequest(self.me(), holds)).gone)

    def complete(self, grant):
        """Deliver a result that depends on the specification only."""
        result = make_result(grant.spec)
        if self._places is not None:
            self._places.uploaded_trace(grant.run, grant.token, result.trace.sha256).touch()
        ours = (self.name, grant.run, grant.attempt, grant.token)
        done = Completion(*ours, result, era=grant.era)
        return self._ask(verbs.COMPLETE, done).answer


def insist(ask, until):
    """Ask again while nobody answers; ``None`` when ``until`` says that it is enough."""
    while not until():
        try:
            return ask()
        except Unreachable:
            time.sleep(0.02)
    return None


class Crew:
    """Light workers in threads that complete runs until stopped, and remember what was answered."""

    def __init__(self, endpoint, state, workers, slots=8):
        self.acknowledged = {}
        self.refused = []
        self._endpoint = endpoint
        self._places = StatePaths(state)
        self._slots = slots
        self._stop = threading.Event()
        self._threads = [
            threading.Thread(target=self._work, args=(f"light-{i}",), daemon=True)
            for i in range(workers)
        ]
        for thread in self._threads:
            thread.start()

    def stop(self):
        """Finish what is under way."""
        self._stop.set()
        for thread in self._threads:
            thread.join()

    def _work(self, name):
        with bus.open_client(self._endpoint) as session:
            worker = LightWorker(session, self._endpoint, name, self._slots, self._places)
            while not self._stop.is_set():
                grants = insist(worker.lease, self._stop.is_set)
                if not isinstance(grants, tuple) or not grants:
                    time.sleep(0.02)
                    continue
                for grant in grants:
                    self._finish(worker, grant)

    def _finish(self, worker, grant):
        try:
            answer = insist(lambda: worker.complete(grant), self._stop.is_set)
        except Refused as error:
            self.refused.append(str(error))
            return
        if answer in (LedgerAnswer.RECORDED, LedgerAnswer.KNOWN):
            self.acknowledged[grant.run] = make_result(grant.spec).digest
