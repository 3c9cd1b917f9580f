"""A Dask cluster as the backend of a worker: each leased run is a future of the cluster.

The future is a call of :func:`execute_run`, which returns result and trace. A Dask worker may not
fork, so it starts zygotes for its runs, as other workers do, and keeps them.

Dask loses results with its scheduler. Running runs then end without blame, and are leased again
with the next scheduler. Runs of a cluster have no live view.
"""

from __future__ import annotations

import hashlib
import logging
import math
import os
import tempfile
import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError
from contextlib import suppress
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any, Final

from distributed import Client, Future, KilledWorker, get_worker
from distributed.security import Security

from daemon.batch.errors import DaemonError, WorkerBroken
from daemon.batch.paths import STATE_VARIABLE
from daemon.batch.run_process import FILES, RESULT, TRACE, WatchDetail
from daemon.batch.worker._attempts import Attempt, AttemptEnd, Waitable, log
from daemon.batch.worker._wakeups import WakeupSocket
from daemon.batch.worker._zygotes import ZygotePool
from daemon.model.execution import RunLimits
from daemon.model.messages import Lease
from daemon.model.spec import RunResult, RunSpec, install_hint, own_version
from grammars.text import codec
from grammars.text.files import write_atomically

_TIMEOUT: Final = 5.0
_PERIOD: Final = 1.0
"""Period of checks of the cluster's workers [s]."""
_TICK: Final = 0.2
"""Period of checks whether a run was cancelled [s]."""
_pools: Final = threading.local()
"""Pools of each thread of a Dask worker, by executor: a zygote ends with the thread that started it
(prctl(2))."""


class DaskExecution:
    """A run in the cluster; at its end result and trace go into the attempt's folder."""

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
        """Take the result of the cluster, in a thread of Dask's client."""
        try:
            end, result, trace = future.result(timeout=None)
        except KilledWorker as error:
            # By default Dask has started it on four workers, and each died with it.
            self._end(AttemptEnd(f"Dask gave up: {error}", counts=True))
        except (Exception, CancelledError) as error:  # a task may raise anything
            self._end(AttemptEnd(f"the Dask cluster did not execute it: {error!r}"))
        else:
            self._end(codec.from_json(AttemptEnd, end), result, trace)
        self._wake()

    def _end(self, end: AttemptEnd, result: bytes = b"", trace: bytes = b"") -> None:
        with self._taking:
            if self.end is not None:
                return  # this worker has stopped it
            try:
                if result:
                    self._keep(result, trace)
            except (OSError, ValueError) as error:
                end = AttemptEnd(f"its result was not stored: {error}")
            self.end = end

    def _keep(self, result: bytes, trace: bytes) -> None:
        if hashlib.sha256(trace).hexdigest() != codec.from_json(RunResult, result).trace.sha256:
            raise ValueError("its trace came damaged from the Dask cluster")
        write_atomically(self.attempt.folder / TRACE, trace)
        write_atomically(self.attempt.folder / RESULT, result)

    def listen(self) -> None:
        """Do nothing: Dask reports the end by itself."""

    def watch(self, _: frozenset[WatchDetail]) -> None:
        """Do nothing: a run in a cluster has no live view."""

    def kill(self, why: str = "") -> None:
        """Cancel the run in the cluster; its process there ends within a second."""
        with suppress(Exception):  # a closing client may raise anything
            self._future.cancel()
        with self._taking:
            self.end = self.end or AttemptEnd(why)

    def close(self) -> None:
        """Do nothing: Dask forgets its future with this object."""


class DaskPool:
    """Executes runs in the Dask cluster at ``address``, as many at a time as it has threads.

    A thread checks the workers every second, and reconnects when the scheduler is gone.
    """

    preparation = None

    def __init__(self, address: str, executor: str, slots: int | None) -> None:
        self._slots = 0
        self.trouble = ""
        self._address = address
        self._executor = executor
        self._most = math.inf if slots is None else slots
        self._client: Client | None = None
        self._versions: dict[str, str] = {}
        self._wakeup = WakeupSocket()
        self.waitables: tuple[Waitable, ...] = (self._wakeup.receiver,)
        self._closing = threading.Event()
        self._watcher = threading.Thread(target=self._watch, name="dask", daemon=True)

    @property
    def slots(self) -> int:
        """Number of runs that the cluster executes at a time, 0 without its scheduler."""
        return self._slots if self._is_connected() else 0

    def _is_connected(self) -> bool:
        client = self._client
        return client is not None and client.status == "running"

    def open(self) -> None:
        """Connect; raises :class:`WorkerBroken` without an answer or if versions differ."""
        # Its tracebacks for every lost connection would hide our own messages.
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
        try:
            self._client = self._connect()
            self._look()
        except Exception as error:  # distributed may raise anything, such as a TypeError
            raise WorkerBroken(f"no Dask scheduler at {self._address}: {error}") from error
        self._watcher.start()

    def close(self) -> None:
        """Leave the cluster, which then stops our runs."""
        self._closing.set()
        if self._watcher.ident is not None:
            self._watcher.join(_TIMEOUT)
        self._drop()
        self._wakeup.close()

    def listen(self) -> None:
        """Take the wake-ups of ended runs and of changes of ``slots``."""
        self._wakeup.take_wakeups()

    def prepare(self, _: RunSpec, __: Path, ___: RunLimits) -> bool:
        """Return true: the cluster compiles kernels where it executes a run."""
        return True

    def start(self, attempt: Attempt, scene: Path, limits: RunLimits) -> DaskExecution:
        """Let the cluster execute an attempt; raises ``OSError`` if it is not reachable now."""
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
            pure=False,  # the same run may be executed again
        )
        return DaskExecution(attempt, future, self._wakeup.wake)

    def _connect(self) -> Client:
        security = Security()  # of Dask's own configuration
        context = security.get_connection_args("client").get("ssl_context")
        if self._address.startswith("tls://") and context is None:
            # Do not create it: a client without certificates never ends (distributed 2026.8).
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
            except Exception as error:  # a closing client may raise anything
                self._note(0, f"the Dask scheduler {self._address} does not answer: {error!r}")

    def _look(self) -> None:
        """Check the cluster's workers, and the versions of new ones.

        By ``run``, not by a task: a Dask worker that cannot import a task dies (distributed
        2026.8).
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
            log(trouble or f"the Dask scheduler {self._address} has workers again")
        self._slots, self.trouble = slots, trouble
        self._wakeup.wake()


def execute_run(
    executor: str, lease: bytes, limits: bytes, scene: bytes, files: dict[str, bytes]
) -> tuple[bytes, bytes, bytes]:
    """Execute a run as a task of Dask; lease and limits are JSON.

    Return an :class:`AttemptEnd` in JSON, and result and trace, which may be empty. JSON avoids
    unpickling objects of another version.
    """
    worker = get_worker()
    key = worker.get_current_task()
    os.environ.setdefault(STATE_VARIABLE, worker.local_directory)
    with tempfile.TemporaryDirectory(prefix="scenario-", dir=worker.local_directory) as name:
        folder = Path(name)
        leased = codec.from_json(Lease, lease)
        attempt = Attempt.prepare(folder / f"attempt-{leased.attempt}", leased)
        scene_file = folder / "scene.json"
        scene_file.write_bytes(scene)
        if files:
            (folder / "files").mkdir()
            for digest, data in files.items():
                (folder / "files" / digest).write_bytes(data)
                (folder / "files" / digest).chmod(0o400)
            attempt.link_files(folder / "files")
        pool: ZygotePool = vars(_pools).setdefault(executor, ZygotePool(1, executor))
        try:
            end = _execute(
                pool,
                attempt,
                scene_file,
                codec.from_json(RunLimits, limits),
                lambda: _is_active(worker, key),
            )
        except (DaemonError, OSError, ValueError) as error:
            end = AttemptEnd(f"not started: {error}")
        if not attempt.finished:
            return codec.to_json(end), b"", b""
        paths = (attempt.folder / RESULT, attempt.folder / TRACE)
        return codec.to_json(end), paths[0].read_bytes(), paths[1].read_bytes()


def _is_active(worker: Any, key: str) -> bool:
    """Return whether a task is active in the worker's own table (distributed 2026.8).

    Dask cannot stop the thread of a task whose future was cancelled or whose client died.
    """
    task = worker.state.tasks.get(key)
    return task is not None and task.state in ("executing", "long-running")


def _execute(
    pool: ZygotePool,
    attempt: Attempt,
    scene: Path,
    limits: RunLimits,
    is_active: Callable[[], bool],
) -> AttemptEnd:
    pool.listen()  # its zygotes may have ended since
    while not pool.prepare(attempt.lease.spec, scene, limits):
        if not is_active():
            return AttemptEnd("stopped")
        wait(pool.waitables, _TICK)
        pool.listen()
    execution = pool.start(attempt, scene, limits)
    while (end := execution.end) is None:
        wait(execution.waitables, max(0.001, min(_TICK, execution.deadline - time.monotonic())))
        execution.listen()
        if not is_active():
            execution.kill("stopped")
    execution.close()
    return end
