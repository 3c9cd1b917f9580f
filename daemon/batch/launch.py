"""Starting daemons from other programs: one that stays, or one that ends with this process."""

from __future__ import annotations

import fcntl
import json
import os
import subprocess
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Final

from daemon.batch.amounts import QUOTA_VARIABLE, parse_size
from daemon.batch.client import Client
from daemon.batch.errors import EXIT_ALREADY_RUNNING, DaemonError, LaunchFailed
from daemon.batch.paths import StatePaths, is_locked, is_same_folder
from daemon.batch.permissions import open_private_log
from daemon.model.execution import DEFAULT_EXECUTOR, python_command

_START_LIMIT: Final = 120.0
_LEAVE_LIMIT: Final = 5.0
"""Time for a daemon to answer, and to exit when its tether is cut, before it is killed [s]."""
_CAMPAIGNS_KEPT: Final = 200
"""Campaigns of a shared daemon that stay when it starts, with the results that these reuse."""
_LOG_TAIL: Final = 20
"""Lines of the log in the message of a failed start."""


def running_daemon(state: Path) -> str | None:
    """Return the endpoint of the daemon that keeps ``state``, or ``None`` without an answer."""
    paths = StatePaths.find(state)
    endpoint = paths.known_endpoint()
    if endpoint is None:
        return None
    try:
        with Client.open(endpoint, timeout=2.0) as client:
            # Another directory's daemon may use the port by now.
            folder = Path(client.overview().state)
            return endpoint if is_same_folder(folder, paths.state) else None
    except DaemonError:
        return None


def ensure_daemon(state: Path, *, slots: int | None = None) -> str:
    """Return the endpoint of the daemon that keeps ``state``, starting one if necessary.

    A started daemon is detached: it outlives this process. Raises :class:`LaunchFailed` with the
    end of its log when it does not come up.
    """
    endpoint = running_daemon(state)
    if endpoint is not None:
        return endpoint
    paths = StatePaths.find(state)
    return _wait_until_up(_start(paths, slots), paths)


def start_detached(
    command: list[str], log: Path, stdin: int = subprocess.DEVNULL
) -> subprocess.Popen[bytes]:
    """Start a process that outlives this one; its output goes to ``log``."""
    with open_private_log(log) as output:
        process = subprocess.Popen(
            command,
            stdin=stdin,
            stdout=output,
            stderr=output,
            start_new_session=True,  # Ctrl-C in a terminal is for this process alone
        )
    # It outlives us. If it ends before, this thread reaps it.
    threading.Thread(target=process.wait, daemon=True).start()
    return process


@contextmanager
def embedded_daemon(
    state: Path,
    *,
    slots: int | None = None,
    wall: float | None = None,
    attempts: int | None = None,
) -> Iterator[str]:
    """Run a daemon and its worker for the duration of a ``with`` block; yield its endpoint.

    ``wall`` is the limit of a run [s]; ``None`` selects the defaults. All processes end with the
    block, even when this process is killed: the daemon, its worker and their children watch a pipe
    that we hold. Raises :class:`LaunchFailed` when it does not come up.
    """
    paths = StatePaths.find(state)
    settings = {"attempts": attempts} if attempts else {}
    limits = {"wall": wall or 0.0}
    process = _start(paths, slots, subprocess.PIPE, settings, tether=True, limits=limits)
    assert process.stdin is not None
    try:
        yield _wait_until_up(process, paths)
    finally:
        process.stdin.close()
        try:
            process.wait(_LEAVE_LIMIT)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


@contextmanager
def shared_daemon(state: Path, *, trace_bytes: int) -> Iterator[str]:
    """Run one daemon for all processes inside such a block of ``state``; yield its endpoint.

    It ends with the last of these processes, even when they are killed: they hold one end of a
    pipe. Its start cancels unfinished campaigns of an earlier block, deletes the oldest campaigns,
    and keeps the newest ``trace_bytes`` bytes of traces.

    Raises :class:`LaunchFailed` when it does not come up.
    """
    paths = StatePaths.find(state)
    paths.make_folders()
    pipe = paths.state / "tether"
    with suppress(FileExistsError):
        os.mkfifo(pipe, 0o600)
    with ExitStack() as cleanup:
        users = os.open(paths.state / "users.lock", os.O_RDWR | os.O_CREAT, 0o600)
        cleanup.callback(os.close, users)
        with _one_at_a_time(paths):
            is_first = _locked_alone(users)
            if is_first:
                # A daemon whose users were killed is about to exit.
                _wait_until_gone(paths)
            # Open at both ends, so that opening it does not block.
            tether = os.open(pipe, os.O_RDWR)
            cleanup.callback(_leave, paths, users, tether)
            endpoint = None if is_first else running_daemon(paths.state)
            if endpoint is None:
                with pipe.open("rb", buffering=0) as stdin:
                    process = _start(paths, None, stdin.fileno(), tether=True)
                    endpoint = _wait_until_up(process, paths)
            if is_first:
                _tidy(paths, endpoint, trace_bytes)
            fcntl.flock(users, fcntl.LOCK_SH)
        yield endpoint


def _leave(paths: StatePaths, users: int, tether: int) -> None:
    """Cut a tether; the last process waits for the end of the daemon."""
    with _one_at_a_time(paths):
        os.close(tether)
        if _locked_alone(users):
            _wait_until_gone(paths)


@contextmanager
def _one_at_a_time(paths: StatePaths) -> Iterator[None]:
    """Let one process at a time start the shared daemon, join it or leave it."""
    with (paths.state / "turn.lock").open("w") as turn:
        fcntl.flock(turn, fcntl.LOCK_EX)
        yield


def _locked_alone(users: int) -> bool:
    try:
        fcntl.flock(users, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _tidy(paths: StatePaths, endpoint: str, trace_bytes: int) -> None:
    """End and delete campaigns of earlier users beyond the limits of :func:`shared_daemon`."""
    with Client.open(endpoint) as client:
        rows = client.campaigns()
        for row in rows:
            if not row.finished:
                client.cancel(row.id)
        for row in rows[_CAMPAIGNS_KEPT:]:
            client.delete((row.id,))
    # Imported here: a mere submission does not need the reader of ledgers.
    from daemon.batch.ledger import RetentionPolicy, sweep_traces

    sweep_traces(paths, RetentionPolicy(size=trace_bytes), time.time())


def _wait_until_gone(paths: StatePaths) -> None:
    deadline = time.monotonic() + _LEAVE_LIMIT
    while is_locked(paths.lock) and time.monotonic() < deadline:
        time.sleep(0.02)


def _start(
    paths: StatePaths,
    slots: int | None,
    stdin: int = subprocess.DEVNULL,
    settings: Mapping[str, object] = {},
    **more: object,
) -> subprocess.Popen[bytes]:
    """Start the daemon of a state directory, with ``more`` parameters of its ``serve``."""
    try:
        quota = parse_size(os.environ.get(QUOTA_VARIABLE) or "0B")
    except ValueError as error:
        raise DaemonError(f"the quota of traces: {error}") from error
    order = {"state": str(paths.state), "slots": slots, "executor": DEFAULT_EXECUTOR, **more}
    order["settings"] = {"quota": quota, **settings}
    paths.make_folders()
    command = python_command("-m", "daemon", "serve", json.dumps(order))
    return start_detached(command, paths.worker_log, stdin)


def _wait_until_up(process: subprocess.Popen[bytes], paths: StatePaths) -> str:
    deadline = time.monotonic() + _START_LIMIT
    while time.monotonic() < deadline:
        endpoint = running_daemon(paths.state)
        if endpoint is not None:
            return endpoint
        code = process.poll()
        # If another process was faster, use its daemon.
        if code is not None and code != EXIT_ALREADY_RUNNING:
            raise LaunchFailed(f"the daemon ended with code {code}:\n{_tail(paths)}")
        time.sleep(0.05)
    process.kill()
    process.wait()
    raise LaunchFailed(f"the daemon did not answer within {_START_LIMIT:g} s:\n{_tail(paths)}")


def _tail(paths: StatePaths) -> str:
    return "\n".join(paths.worker_log.read_text("utf-8", "replace").splitlines()[-_LOG_TAIL:])
