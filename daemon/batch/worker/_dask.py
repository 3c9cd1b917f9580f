"""A Dask cluster as the backend of a worker: each run it leases is a future of the cluster.

Dask keeps no results over the loss of its scheduler. Runs under way end without blame then, and are
leased again once there is a scheduler. Nobody sees a run of a cluster live.
"""

from __future__ import annotations

import hashlib
import logging
import math
import threading
from collections.abc import Callable
from concurrent.futures import CancelledError
from contextlib import suppress
from pathlib import Path
from typing import Final

from distributed import Client, Future, KilledWorker
from distributed.security import Security

from daemon.batch.errors import WorkerBroken
from daemon.batch.run_process import FILES, RESULT, TRACE, WatchDetail
from daemon.batch.worker._attempts import Attempt, AttemptEnd, Waitable
from daemon.batch.worker._dask_task import execute_run
from daemon.batch.worker._wakeups import WakeupSocket
from daemon.model.execution import RunLimits
from daemon.model.spec import RunResult, RunSpec, install_hint, own_version
from grammars.text import codec
from grammars.text.files import write_atomically

_TIMEOUT: Final = 5.0
_PERIOD: Final = 1.0
"""Seconds between two looks at who is in the cluster."""


class DaskExecution:
    """A run in the cluster; its result and trace come into the attempt's folder at its end."""

    live = judged = b""
    deadline = math.inf
    waitables: tuple[Waitable, ...] = ()

    def __init__(self, attempt: Attempt, future: Future, wake: Callable[[], None]) -> None:
        self.attempt = attempt
        self.end: AttemptEnd | None = None
        self._future = future
        self._wake = wake
        self._taking = threading.Lock()
        future.add_done_callback(self._take)

    def _take(self, future: Future) -> None:
        """Take what the cluster returns, in a thread of Dask's client."""
        try:
            end, result, trace = future.result(timeout=None)
        except KilledWorker as error:
            # By default Dask has begun it on four workers, and each died with it.
            self._end(AttemptEnd(f"Dask gave up: {error}", counts=True))
        except (Exception, CancelledError) as error:  # whatever a task may raise there
            self._end(AttemptEnd(f"the Dask cluster did not execute it: {error!r}"))
        else:
            self._end(codec.from_json(AttemptEnd, end), result, trace)
        self._wake()

    def _end(self, end: AttemptEnd, result: bytes = b"", trace: bytes = b"") -> None:
        with self._taking:
            if self.end is not None:
                return  # it was stopped here
            try:
                if result:
                    self._keep(result, trace)
            except (OSError, ValueError) as error:
                end = AttemptEnd(f"its result was not kept: {error}")
            self.end = end

    def _keep(self, result: bytes, trace: bytes) -> None:
        if hashlib.sha256(trace).hexdigest() != codec.from_json(RunResult, result).trace.sha256:
            raise ValueError("its trace came damaged from the Dask cluster")
        write_atomically(self.attempt.folder / TRACE, trace)
        write_atomically(self.attempt.folder / RESULT, result)

    def listen(self) -> None:
        """Nothing: the end comes by itself."""

    def watch(self, _: frozenset[WatchDetail]) -> None:
        """Nothing: what a run in a cluster does is not seen from here."""

    def kill(self, why: str = "") -> None:
        """Let the cluster forget the run; its process there ends within a second."""
        with suppress(Exception):  # whatever a client raises that is closing
            self._future.cancel()
        with self._taking:
            self.end = self.end or AttemptEnd(why)

    def close(self) -> None:
        """Nothing: Dask forgets its future with this object."""


class DaskPool:
    """Executes runs in the Dask cluster at ``address``, as many at a time as it has threads.

    A thread looks every second who is there, and connects again when the scheduler is gone.
    """

    preparation = None

    def __init__(
        self, address: str, executor: str, slots: int | None, log: Callable[[str], None]
    ) -> None:
        self._slots = 0
        self.trouble = ""
        self._address = address
        self._executor = executor
        self._most = math.inf if slots is None else slots
        self._log = log
        self._client: Client | None = None
        self._versions: dict[str, str] = {}
        self._wakeup = WakeupSocket()
        self.waitables: tuple[Waitable, ...] = (self._wakeup.receiver,)
        self._closing = threading.Event()
        self._watcher = threading.Thread(target=self._watch, name="dask", daemon=True)

    @property
    def slots(self) -> int:
        """Runs that the cluster executes at a time, none without its scheduler."""
        return self._slots if self._is_connected() else 0

    def _is_connected(self) -> bool:
        client = self._client
        return client is not None and client.status == "running"

    def open(self) -> None:
        """Connect; raises :class:`WorkerBroken` when nobody answers or versions differ."""
        # Its tracebacks for every loss of the connection would bury what we say about it.
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
        try:
            self._client = self._connect()
            self._look()
        except Exception as error:  # distributed raises anything, TypeError for a certificate say
            raise WorkerBroken(f"no Dask scheduler at {self._address}: {error}") from error
        self._watcher.start()

    def close(self) -> None:
        """Leave the cluster; what it still executes for us is stopped there."""
        self._closing.set()
        if self._watcher.ident is not None:
            self._watcher.join(_TIMEOUT)
        self._drop()
        self._wakeup.close()

    def listen(self) -> None:
        """Take the wake-ups: runs have ended, or ``slots`` have changed."""
        self._wakeup.take_wakeups()

    def prepare(self, _: RunSpec, __: Path, ___: RunLimits) -> bool:
        """Whether a run can start: what it needs is compiled where it is executed."""
        return True

    def start(self, attempt: Attempt, scene: Path, limits: RunLimits) -> DaskExecution:
        """Have the cluster execute an attempt; raises ``OSError`` when that is not possible now."""
        client = self._client
        if client is None or not self._is_connected():
            raise ConnectionError(f"the Dask scheduler {self._address} does not answer")
        spec = attempt.lease.spec
        files = {digest: (attempt.folder / FILES / digest).read_bytes() for digest in spec.files}
        future = client.submit(
            execute_run,
            self._executor,
            codec.to_json(attempt.lease),
            codec.to_json(limits),
            scene.read_bytes(),
            files,
            pure=False,  # the same run may be wanted again
        )
        return DaskExecution(attempt, future, self._wakeup.wake)

    def _connect(self) -> Client:
        security = Security()  # of Dask's own configuration
        context = security.get_connection_args("client").get("ssl_context")
        if self._address.startswith("tls://") and context is None:
            # A client without certificates never ends (distributed 2026.8), so it is not made.
            raise ValueError("tls:// needs certificates in Dask's configuration")
        client = Client(self._address, security=security, timeout=_TIMEOUT, set_as_default=False)
        try:
            answer = client.run_on_scheduler(own_version)
        except ImportError as error:
            answer = repr(error)
        if answer != own_version():
            client.close(_TIMEOUT)
            raise ValueError(f"it has {answer}: {install_hint(own_version())}")
        return client

    def _drop(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close(_TIMEOUT)

    def _watch(self) -> None:
        while not self._closing.wait(_PERIOD):
            try:
                if not self._is_connected():
                    self._drop()
                    self._client = self._connect()
                self._look()
            except Exception as error:  # a client that is closing raises anything
                self._note(0, f"the Dask scheduler {self._address} does not answer: {error!r}")

    def _look(self) -> None:
        """Look who is in the cluster, and what newcomers have installed.

        They are asked by ``run``, not by a task: a Dask worker that cannot import a task dies of
        it (distributed 2026.8).
        """
        client = self._client
        assert client is not None
        threads: dict[str, int] = client.nthreads()
        new = sorted(threads.keys() - self._versions.keys())
        if new:
            answers = client.run(own_version, workers=new, on_error="return")
            self._versions.update((address, str(answer)) for address, answer in answers.items())
        self._versions = {one: self._versions[one] for one in threads if one in self._versions}
        for address, version in self._versions.items():
            if version != own_version():
                hint = install_hint(own_version())
                self._note(0, f"the Dask worker {address} has {version}: {hint}")
                return
        trouble = "" if threads else f"the Dask scheduler {self._address} has no workers"
        self._note(int(min(self._most, sum(threads.values()))), trouble)

    def _note(self, slots: int, trouble: str) -> None:
        if (slots, trouble) == (self._slots, self.trouble):
            return
        if trouble != self.trouble:
            self._log(trouble or f"the Dask scheduler {self._address} has workers again")
        self._slots, self.trouble = slots, trouble
        self._wakeup.wake()
