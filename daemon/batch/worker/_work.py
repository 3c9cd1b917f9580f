"""The process of a worker: warm up, register with the daemon, work, stop."""

from __future__ import annotations

import os
from contextlib import ExitStack
from dataclasses import replace
from multiprocessing.connection import wait
from pathlib import Path
from typing import Final, Literal

from daemon.batch import bus
from daemon.batch.errors import Unreachable, WorkerBroken
from daemon.batch.paths import StatePaths, is_encrypted
from daemon.batch.security import find_credentials
from daemon.batch.worker._attempts import Spool, log
from daemon.batch.worker._connection import DaemonConnection, choose_paths, describe_worker
from daemon.batch.worker._loop import Backend, WorkerLoop
from daemon.batch.worker._wakeups import WorkerSignals
from daemon.batch.worker._zygotes import ZygotePool
from daemon.model.execution import DEFAULT_EXECUTOR, RunLimits, available_cores, decide_on_commands
from daemon.model.messages import ALIVE, WORK, WelcomeReply
from daemon.model.verbs import Role
from daemon.supervision.child import lower_session, when_stdin_ends
from grammars.text.plugins import install_command

_ASK_AGAIN: Final = 1.0
"""Period of registrations while no daemon answers [s]."""


def work(
    connect: str,
    *,
    slots: int | None = None,
    state: Path | None = None,
    limits: RunLimits | None = None,
    executor: str = DEFAULT_EXECUTOR,
    keys: Path | None = None,
    tether: Literal["", "finish", "exit"] = "",
    dask: str = "",
    nice: int = 0,
    commands: bool | None = None,
) -> None:
    """Execute runs of the daemon at ``connect`` until a stop signal.

    ``slots`` runs at a time (``None``: one per core, or per thread of the Dask cluster at the
    address ``dask`` that executes them). If the daemon's state directory is reachable, at its own
    path or as ``state``, spool and traces are there. Otherwise the worker has a folder of its own,
    in ``state`` or the user's state folder, and sends traces. ``executor`` (``module:function``)
    executes runs and never comes from the network. With ``tether`` the worker exits at once, or
    finishes, when its standard input closes. ``nice`` lowers the priority of the session it leads,
    not only that of each run below the worker. ``commands``: whether runs may start commands of SUT
    files; ``None``: only for a daemon on this machine. Call it from the main thread.

    SIGTERM or SIGINT: finish running runs, then stop. A second one, or SIGQUIT: return them.

    Raises :class:`daemon.batch.errors.Unreachable` when no daemon answers at the start and
    :class:`WorkerBroken` when runs cannot be executed here.
    """
    # The order of these steps matters.
    if tether == "exit":
        when_stdin_ends(lambda: os._exit(1))
    if nice:
        lower_session(nice)
    # Before the first fork, which inherits it.
    decide_on_commands(commands, is_remote=is_encrypted(connect))
    with ExitStack() as stack:
        signals = WorkerSignals()
        stack.callback(signals.close)
        if tether == "finish":
            when_stdin_ends(signals.leave)
        stack.enter_context(signals.handled())
        # Before the session opens, so that its processes do not inherit Zenoh, and a worker that
        # cannot execute runs has not leased any.
        backend = _open_backend(slots, executor, dask, stack)
        holder = find_credentials(Role.WORKER, keys) if is_encrypted(connect) else None
        session = stack.enter_context(bus.open_client(connect, holder))
        daemon = DaemonConnection(session, connect, holder)
        welcome: WelcomeReply | None = daemon.ask_welcome(describe_worker())
        while welcome is not None and _serve(daemon, welcome, state, backend, signals, limits):
            welcome = _ask_again(daemon, signals)


def _serve(
    daemon: DaemonConnection,
    welcome: WelcomeReply,
    state: Path | None,
    backend: Backend,
    signals: WorkerSignals,
    limits: RunLimits | None,
) -> bool:
    """Execute runs of one ledger; return whether another ledger answers now."""
    # A new id for each ledger, so that the old part of the spool has no owner after its end.
    me = replace(describe_worker(), era=welcome.era)
    with ExitStack() as stack:
        paths = choose_paths(state, welcome)
        spool = _open_spool(paths.state, me.id)
        stack.callback(spool.close)
        # Register the token when the worker can take runs; it ends with the session.
        session = daemon.session
        stack.enter_context(session.liveliness().declare_token(f"{ALIVE}/{daemon.name}/{me.id}"))
        stack.enter_context(session.declare_subscriber(WORK, lambda _: signals.wake()))
        loop = WorkerLoop(
            daemon,
            me,
            paths,
            spool,
            backend,
            signals,
            limits=limits or RunLimits(),
            renew=welcome.renew,
        )
        where = paths.state.state
        log(f"{me.id} works for {daemon.endpoint} with {backend.slots} slots in {where}")
        has_other_ledger = loop.run()
        log(f"{me.id} stops")
    return has_other_ledger


def _ask_again(daemon: DaemonConnection, signals: WorkerSignals) -> WelcomeReply | None:
    """Register with any daemon that answers, until a stop signal."""
    while not signals.drain:
        try:
            return daemon.ask_welcome(describe_worker())
        except Unreachable:
            wait([signals.receiver], _ASK_AGAIN)
            signals.take_wakeups()
    return None


def _open_spool(paths: StatePaths, worker: str) -> Spool:
    """Make the worker's part of the spool; raises :class:`WorkerBroken`."""
    try:
        return Spool(paths, worker)
    except OSError as error:
        raise WorkerBroken(f"this worker cannot store results: {error}") from error


def _open_backend(slots: int | None, executor: str, dask: str, stack: ExitStack) -> Backend:
    """Open and test the backend that executes runs; raises :class:`WorkerBroken`."""
    if not dask:
        pool = ZygotePool(available_cores() if slots is None else slots, executor)
        stack.callback(pool.close)
        pool.warm_up()
        return pool
    try:
        from daemon.batch.worker._dask import DaskPool
    except ImportError as error:
        raise WorkerBroken(
            f"a Dask cluster needs the extra: {install_command('dask')} ({error})"
        ) from error
    cluster = DaskPool(dask, executor, slots)
    stack.callback(cluster.close)
    cluster.open()
    return cluster
