"""Runs in a Dask cluster: a task executes one and returns its result and trace.

A Dask worker may not fork and has not loaded our modules. So it keeps a starter process that has:
``python -m daemon.batch.worker._dask_task EXECUTOR FOLDER``. A starter executes one run after the
other, each in a process of its own, and ends when its standard input closes.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any, Final

from daemon.batch.errors import DaemonError
from daemon.batch.paths import STATE_VARIABLE
from daemon.batch.run_process import RESULT, TRACE
from daemon.batch.worker._attempts import Attempt, AttemptEnd
from daemon.batch.worker._zygotes import ZygotePool
from daemon.model.execution import RunLimits, python_command
from daemon.model.messages import Lease
from grammars.text import codec

_TICK: Final = 0.2
"""Period of checks whether the task was cancelled [s]."""
_ENDED: Final = AttemptEnd("the process that starts runs on the Dask worker ended")
_idle: Final[defaultdict[str, list[subprocess.Popen[bytes]]]] = defaultdict(list)
"""Idle starters of this Dask worker, by executor."""


@dataclass(frozen=True, slots=True)
class StartRequest:
    """The order to execute the attempt in ``folder`` on a scene, within ``limits``."""

    folder: str
    scene: str
    limits: RunLimits


def execute_run(
    executor: str, lease: bytes, limits: bytes, scene: bytes, files: dict[str, bytes]
) -> tuple[bytes, bytes, bytes]:
    """Execute a run as a task of Dask; lease and limits are JSON.

    Return an :class:`AttemptEnd` in JSON, and result and trace, which may be empty. JSON avoids
    unpickling objects of another version.
    """
    from distributed import get_worker

    worker = get_worker()
    key = worker.get_current_task()
    with tempfile.TemporaryDirectory(prefix="scenario-", dir=worker.local_directory) as name:
        folder = Path(name)
        leased = codec.from_json(Lease, lease)
        attempt = Attempt.prepare(folder / f"attempt-{leased.attempt}", leased)
        (folder / "scene.json").write_bytes(scene)
        if files:
            (folder / "files").mkdir()
            for digest, data in files.items():
                (folder / "files" / digest).write_bytes(data)
                (folder / "files" / digest).chmod(0o400)
            attempt.link_files(folder / "files")
        request = StartRequest(
            str(attempt.folder), str(folder / "scene.json"), codec.from_json(RunLimits, limits)
        )
        end = _ask_starter(
            executor, worker.local_directory, request, lambda: _is_active(worker, key)
        )
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


def _ask_starter(
    executor: str, directory: str, request: StartRequest, is_active: Callable[[], bool]
) -> AttemptEnd:
    idle = _idle[executor]
    starter = idle.pop() if idle else _start(executor, directory)
    assert starter.stdin is not None
    assert starter.stdout is not None
    try:
        starter.stdin.write(codec.to_json(request) + b"\n")
        while not wait([starter.stdout.fileno()], _TICK):
            if not is_active():
                return AttemptEnd("stopped")
        answer = starter.stdout.readline()
    except BrokenPipeError:
        return _ENDED
    else:
        if answer:
            idle.append(starter)
        return codec.from_json(AttemptEnd, answer) if answer else _ENDED
    finally:
        if starter not in idle:
            starter.stdin.close()
            starter.wait()


def _start(executor: str, directory: str) -> subprocess.Popen[bytes]:
    command = python_command("-m", "daemon.batch.worker._dask_task", executor, directory)
    return subprocess.Popen(
        command, bufsize=0, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
    )


def main() -> None:
    """Execute the requests of standard input; answer each on standard output."""
    executor, directory = sys.argv[1:]
    # Ctrl-C is for the Dask worker, whose end closes standard input.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.dup(sys.stdout.fileno())
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    os.environ.setdefault(STATE_VARIABLE, directory)
    pool: ZygotePool | None = None
    while line := sys.stdin.buffer.readline():
        try:
            if pool is None:
                pool = ZygotePool(1, executor)
                pool.warm_up()
            end = _execute(pool, codec.from_json(StartRequest, line))
        except (DaemonError, OSError, ValueError) as error:
            end = AttemptEnd(f"not started: {error}")
        os.write(answers, codec.to_json(end) + b"\n")


def _execute(pool: ZygotePool, request: StartRequest) -> AttemptEnd:
    attempt = Attempt.read(Path(request.folder))
    # There are no requests during a run: any input is the end.
    stdin = sys.stdin.fileno()
    while not pool.prepare(attempt.lease.spec, Path(request.scene), request.limits):
        if stdin in wait([stdin, *pool.waitables]):
            return AttemptEnd("stopped")
        pool.listen()
    execution = pool.start(attempt, Path(request.scene), request.limits)
    while (end := execution.end) is None:
        remaining = max(0.001, execution.deadline - time.monotonic())
        if stdin in wait([stdin, *execution.waitables], remaining):
            execution.kill("stopped")
        execution.listen()
    execution.close()
    return end


if __name__ == "__main__":
    main()
