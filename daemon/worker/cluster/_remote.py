"""What the cluster executes: imported there by name from the installed package."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

from distributed import get_worker
from distributed.core import Status

from daemon.errors import WorkerBroken
from daemon.versions import identity
from daemon.worker.cluster._household import household
from daemon.worker.cluster._job import Fate, Job, News, Report
from grammars import codec

_LIVE_PERIOD: Final = 1.0
_LEAVING: Final = (Status.closing, Status.closed, Status.failed)


def prove(executor: str) -> bytes:
    """Be warm here, or say what is wrong: a :class:`Report` of ``done`` or ``unfit`` in JSON."""
    worker = get_worker()
    words = ""
    try:
        household(executor, worker.local_directory)
    except (WorkerBroken, OSError) as error:
        words = f"Dask worker {worker.address}: {error}"
    return codec.to_json(Report(Fate.UNFIT if words else Fate.DONE, worker.address, words))


def execute(version: str, job: bytes, *given: bytes) -> tuple[bytes, bytes, bytes]:
    """Execute a :class:`Job` of that version: a :class:`Report`, the result (both in JSON) and
    the trace.

    Scene and files not ``given`` are those this Dask worker has kept, or the report asks for them.
    """
    worker = get_worker()
    report, result, trace = Report(Fate.UNFIT, worker.address), b"", b""
    try:
        if version == identity():
            report, result, trace = _execute(worker, codec.from_json(Job, job), given)
        else:
            report = replace(report, words=f"{worker.address} has {identity()}")
    except WorkerBroken as error:
        report = replace(report, words=str(error))
    except (OSError, ValueError) as error:
        report = Report(Fate.FAILED, worker.address, str(error))
    return codec.to_json(report), result, trace


def _execute(worker: Any, job: Job, given: tuple[bytes, ...]) -> tuple[Report, bytes, bytes]:
    where = worker.address
    house = household(job.executor, worker.local_directory)
    house.keep(job.grant.spec, given)
    missing = house.missing(job.grant.spec)
    if missing:
        return Report(Fate.MISSING, where, missing=missing), b"", b""
    key = worker.get_current_task()
    left = house.run(
        job.grant, job.limits, lambda: _wanted(worker, key), _teller(worker, job.topic, key)
    )
    if left.result:
        return Report(Fate.DONE, where), left.result, left.trace
    fate = Fate.FAILED if _wanted(worker, key) else Fate.STOPPED
    return Report(fate, where, left.told.why, left.told.blame, left.told.lacks), b"", b""


def _wanted(worker: Any, key: str) -> bool:
    """Whether the scheduler still wants this task.

    A task whose future was cancelled, whose gateway died, or whose scheduler went, goes on
    executing in state ``cancelled``: a thread cannot be stopped, only its process.
    """
    if worker.status in _LEAVING:
        return False
    task = worker.state.tasks.get(key)
    return task is not None and task.state in ("executing", "long-running")


def _teller(worker: Any, topic: str, key: str) -> Callable[[str], None]:
    following = 0.0

    def tell(live: str) -> None:
        nonlocal following
        now = time.monotonic()
        if now >= following:
            following = now + _LIVE_PERIOD
            worker.log_event(topic, codec.to_json(News(key, live)).decode())

    return tell
