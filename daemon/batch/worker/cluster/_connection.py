"""The connection to a Dask scheduler: kept up, and clear about which of its workers are fit."""

from __future__ import annotations

import logging
import threading
import uuid
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

from distributed import Client, Future
from distributed.security import Security

from daemon.batch.errors import WorkerBroken
from daemon.batch.worker.cluster import _remote
from daemon.batch.worker.cluster._remote import JobReport, JobStatus
from daemon.model.execution import DaskScheduler
from daemon.model.spec import install_hint, own_version
from grammars.text import codec

_TIMEOUT: Final = 5.0
_PERIOD: Final = 0.5
"""Seconds between two looks at who is there."""
_AFTER_LOSS: Final = 1.0

_NO_CONNECTION: Final = (OSError, ValueError, TypeError, RuntimeError)
"""What Dask raises for an address, a certificate or a scheduler that is of no use."""
_EXPECTED: Final = (WorkerBroken, *_NO_CONNECTION)


def _security(scheduler: DaskScheduler) -> Security:
    """Raises ``OSError`` or ``ValueError`` for what would not do.

    A client that fails for such a reason never ends: its destructor waits for ever (distributed
    2026.8), so it is not made.
    """
    files = {
        "tls_ca_file": scheduler.ca,
        "tls_client_cert": scheduler.certificate,
        "tls_client_key": scheduler.key,
    }
    security = Security(**{name: str(path) for name, path in files.items() if path is not None})
    if not scheduler.address.startswith("tls://"):
        if security.require_encryption:
            raise ValueError("Dask's configuration wants encryption, so tls://")
    elif security.get_connection_args("client").get("ssl_context") is None:
        raise ValueError("tls:// needs --tls-ca, --tls-cert and --tls-key")
    return security


@dataclass(frozen=True, slots=True)
class _DaskWorker:
    """A Dask worker: asked by ``proof`` whether it executes runs, then fit, or not for a reason."""

    proof: Future | None = None
    threads: int = 0
    unfit: str = ""


class ClusterConnection:
    """A thread that looks at the cluster twice a second, and connects again when it is gone.

    Dask keeps no results over the loss of its scheduler, and a client that reconnects finds all of
    its futures cancelled. So the client is thrown away and made anew; attempts that were under way
    end without blame and are leased again. Results are the ledger's business, not the cluster's.
    """

    def __init__(
        self,
        scheduler: DaskScheduler,
        executor: str,
        *,
        changed: Callable[[], None],
        on_event: Callable[[object], None],
        log: Callable[[str], None],
    ) -> None:
        self._scheduler = scheduler
        self._executor = executor
        self._changed = changed
        self._on_event = on_event
        self._log = log
        self._client: Client | None = None
        self._lock = threading.Lock()
        # By address. Written by the thread here and, when a job finds its worker unfit, by Dask's.
        self._workers: dict[str, _DaskWorker] = {}
        # What those who watch want of jobs that are being told, by key: Dask worker, words.
        self._wishes: dict[str, tuple[str, tuple[str, ...]]] = {}
        self._leaving = threading.Event()
        self._keeper = threading.Thread(target=self._keep, name="cluster", daemon=True)
        self.topic = f"scenario-{uuid.uuid4().hex}"

    @property
    def has_only_unfit(self) -> bool:
        """Whether there are workers and none of them is fit."""
        with self._lock:
            return bool(self._workers) and all(one.unfit for one in self._workers.values())

    @property
    def shortage(self) -> str:
        """Why no worker of the cluster executes runs right now; empty when one does."""
        where = f"the Dask scheduler {self._scheduler.address}"
        if not self.connected:
            return f"{where} does not answer: start it again, at that address"
        with self._lock:
            unfit = [one.unfit for one in self._workers.values() if one.unfit]
            others = len(self._workers) - len(unfit)
            if any(one.threads for one in self._workers.values()):
                return ""
        if others:
            return f"{others} Dask workers of {where} are not ready yet"
        if unfit:
            return f"none of the Dask workers of {where} can execute runs: {unfit[0]}"
        return f"{where} has no workers: see that theirs are started again when they end"

    def open(self) -> None:
        """Connect; raises :class:`WorkerBroken` when nobody answers or versions differ."""
        # Its traceback for every loss of the connection would bury what we say about it.
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
        try:
            self._connect()
        except _NO_CONNECTION as error:
            raise WorkerBroken(
                f"no connection to the Dask scheduler {self._scheduler.address}: {error}"
            ) from error
        self._keeper.start()

    def close(self) -> None:
        """Leave the cluster; what it still executes for us is stopped there."""
        self._leaving.set()
        if self._keeper.ident is not None:
            self._keeper.join(_TIMEOUT)
        self._drop()

    @property
    def connected(self) -> bool:
        """Whether jobs can be submitted."""
        client = self._client
        return client is not None and client.status == "running"

    @property
    def threads(self) -> int:
        """How many jobs the fit workers of the cluster execute at a time."""
        with self._lock:
            return sum(one.threads for one in self._workers.values())

    def submit(self, job: bytes, given: Sequence[bytes]) -> tuple[Future, frozenset[str]]:
        """Have the cluster execute a job; raises ``OSError`` when that is not possible now.

        The workers returned are the only ones that may; none: whoever is there or comes. A Dask
        worker that cannot import what it is told to execute dies of it, so unfit ones are spared.
        """
        client = self._client
        if client is None or not self.connected:
            raise ConnectionError(f"the Dask scheduler {self._scheduler.address} is gone")
        with self._lock:
            some_unfit = any(one.unfit for one in self._workers.values())
            workers = self._fit if some_unfit else frozenset()
        try:
            future = client.submit(
                _remote.execute_job,
                own_version(),
                job,
                *given,
                workers=list(workers) or None,
                retries=0,  # the ledger counts attempts
                pure=False,  # the same run may be wanted again
            )
        except (RuntimeError, TypeError) as error:  # it was closed in the meantime
            raise ConnectionError(f"the Dask client is gone: {error}") from error
        return future, workers

    def watch(self, worker: str, key: str, wanted: Sequence[str]) -> None:
        """Tell a job on a Dask worker what those who watch it want; lost when that is gone."""
        with self._lock:
            begun = key in self._wishes
            self._wishes[key] = (worker, tuple(wanted))
        # It asks the scheduler, and a frozen one must not stop who keeps leases. One thread for
        # each job: what was wanted first must not arrive last.
        if not begun:
            threading.Thread(target=self._tell_wish, args=(key,), name="watch", daemon=True).start()

    def _tell_wish(self, key: str) -> None:
        """Tell a job what is wanted of it, again while that has changed meanwhile."""
        told: tuple[str, tuple[str, ...]] | None = None
        while True:
            with self._lock:
                wish = self._wishes[key]
                if wish == told:
                    del self._wishes[key]
                    return
            told = wish
            worker, wanted = wish
            client = self._client
            if client is not None and self.connected:
                # Whatever a client raises that is closing: nobody is told then.
                with suppress(Exception):
                    client.run(
                        _remote.watch_job, self._executor, key, wanted,
                        workers=[worker], on_error="ignore",
                    )  # fmt: skip

    def has_no_worker(self, workers: frozenset[str]) -> bool:
        """Whether a job that only these workers may execute waits for ever."""
        with self._lock:
            return bool(workers) and workers.isdisjoint(self._fit)

    @property
    def _fit(self) -> frozenset[str]:
        return frozenset(address for address, one in self._workers.items() if one.threads)

    def exclude(self, worker: str, words: str) -> None:
        """Give that worker no more jobs."""
        with self._lock:
            self._workers[worker] = _DaskWorker(unfit=words)
        self._log(f"not used: {words}")
        self._changed()

    def _keep(self) -> None:
        lost = False
        while not self._leaving.wait(_AFTER_LOSS if lost else _PERIOD):
            try:
                if not self.connected:
                    self._drop()
                    self._connect()
                self._update_workers()
            except Exception as error:
                # Whatever it is: without this thread nobody would ever connect again. A client that
                # is closing raises AttributeError or CancelledError, say (distributed 2026.8).
                if not lost:
                    words = error if isinstance(error, _EXPECTED) else repr(error)
                    self._log(f"without the Dask scheduler {self._scheduler.address}: {words}")
                lost = True
            else:
                if lost:
                    self._log(f"the Dask scheduler {self._scheduler.address} is back")
                lost = False

    def _connect(self) -> None:
        client = Client(
            self._scheduler.address,
            security=_security(self._scheduler),
            timeout=_TIMEOUT,
            set_as_default=False,
        )
        try:
            self._check_scheduler(client)
        except BaseException:
            client.close()
            raise
        client.subscribe_topic(self.topic, lambda event: self._on_event(event[1]))
        self._client = client

    def _check_scheduler(self, client: Client) -> None:
        try:
            answer = client.run_on_scheduler(own_version)
        except (ImportError, AttributeError) as error:
            answer = error
        words = _version_mismatch(f"the Dask scheduler {self._scheduler.address}", answer)
        if words:
            raise WorkerBroken(words)

    def _drop(self) -> None:
        client, self._client = self._client, None
        with self._lock:
            self._workers.clear()
        if client is not None:
            client.close(timeout=_TIMEOUT)
        self._changed()

    def _update_workers(self) -> None:
        client = self._client
        assert client is not None
        threads: dict[str, int] = client.nthreads()
        with self._lock:
            before = dict(self._workers)
            for address in before.keys() - threads.keys():
                del self._workers[address]
            known = dict(self._workers)
        new = threads.keys() - known.keys()
        if new:
            self._check_new(client, sorted(new))
        for address, one in known.items():
            if one.proof is not None and one.proof.done():
                self._take_proof(address, one.proof, threads[address])
        if before != self._workers:
            self._changed()

    def _check_new(self, client: Client, new: list[str]) -> None:
        """Ask new workers who they are, and those of our version to get ready.

        Asked by ``run``, not by a task: a worker that cannot import a task dies of it (distributed
        2026.8), and with it what it executes for others.
        """
        answers = client.run(own_version, workers=new, on_error="return")
        for address, answer in answers.items():
            if isinstance(answer, OSError):
                continue  # it left already, or is asked again at the next look
            words = _version_mismatch(f"Dask worker {address}", answer)
            if words:
                self.exclude(address, words)
                continue
            proof = client.submit(
                _remote.start_launcher, self._executor, workers=[address], retries=0, pure=False
            )
            with self._lock:
                self._workers[address] = _DaskWorker(proof)

    def _take_proof(self, address: str, proof: Future, threads: int) -> None:
        words = "" if proof.status == "cancelled" else _unfit_reason(address, proof)
        if words:
            self.exclude(address, words)
            return
        with self._lock:
            if proof.status == "cancelled":
                self._workers.pop(address, None)  # asked again at the next look
            else:
                self._workers[address] = _DaskWorker(threads=threads)


def _unfit_reason(address: str, proof: Future) -> str:
    """What is wrong with the worker at ``address``, empty when nothing is."""
    error = proof.exception(timeout=_TIMEOUT)
    if error is not None:
        return f"Dask worker {address}: {error!r}"
    report = codec.from_json(JobReport, proof.result(timeout=_TIMEOUT))
    return report.end.why if report.status is JobStatus.UNFIT else ""


def _version_mismatch(place: str, answer: object) -> str:
    """What is wrong at ``place``, which said who it is, or raised; empty when nothing is."""
    ours = own_version()
    if answer == ours:
        return ""
    if isinstance(answer, Exception):
        return f"{place} cannot import this program ({answer}): {install_hint(ours)}"
    return f"{place} has {answer}, the gateway {ours}: {install_hint(ours)}"
