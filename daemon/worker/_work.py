"""A worker's life: get to know the daemon, warm up, work, leave."""

from __future__ import annotations

import os
import re
import secrets
import socket
import sys
from contextlib import ExitStack, suppress
from dataclasses import replace
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from typing import Final

from daemon import bus
from daemon.errors import Refused, WorkerBroken
from daemon.executor import DEFAULT_EXECUTOR, EXECUTOR_VARIABLE, Limits, cores
from daemon.messages import ALIVE, WORK, Verb, Welcome, WorkerInfo
from daemon.places import Places
from daemon.worker._agent import Agent, Link
from daemon.worker._children import Nursery
from daemon.worker._signals import Orders
from daemon.worker._signals import tether as hold_tether
from daemon.worker._spool import Spool

_HOST_PART: Final = 40


def work(
    connect: str,
    *,
    slots: int | None = None,
    state: Path | None = None,
    limits: Limits | None = None,
    executor: str = DEFAULT_EXECUTOR,
    parent: int = 0,
    tether: bool = False,
) -> None:
    """Execute runs of the daemon at ``connect`` until told to leave.

    ``slots`` runs at a time (``None``: one per core). Spool and traces lie in the daemon's state
    directory, which must be reachable here under the same path or be given as ``state``.
    ``executor`` (``module:function``) executes runs and is never taken from the network. With
    ``parent`` the worker finishes and leaves when that process is not its parent any more; with
    ``tether`` it dies when its standard input closes. To be called from the main thread.

    SIGTERM or SIGINT: finish what runs, then leave. A second one, or SIGQUIT: give it back.

    Raises :class:`daemon.errors.Unreachable` when no daemon answers at the start and
    :class:`WorkerBroken` when runs cannot be executed here.
    """
    if tether:
        hold_tether()
    _prepare_environment(executor)
    slots = cores() if slots is None else slots
    me = _introduce(slots)
    with ExitStack() as stack:
        orders = Orders(parent=parent)
        stack.callback(orders.close)
        stack.enter_context(orders.signals())
        nursery = Nursery(slots)
        nursery.prove()
        session = stack.enter_context(bus.open_client(connect))
        link = Link(session, connect)
        welcome = _meet(link, me)
        places = _reach(state or Path(welcome.state))
        spool = Spool(places, me.id)
        stack.callback(spool.close)
        stack.enter_context(session.liveliness().declare_token(f"{ALIVE}/{me.id}"))
        stack.enter_context(session.declare_subscriber(WORK, lambda _: orders.hint()))
        agent = Agent(
            link,
            lambda busy: replace(me, busy=busy, slots=nursery.slots),
            places,
            spool,
            nursery,
            orders,
            limits=limits or Limits(),
            renew=welcome.renew,
            log=_log,
        )
        _log(f"{me.id} works for {connect} with {slots} slots")
        agent.run()
        _log(f"{me.id} leaves")


def _prepare_environment(executor: str) -> None:
    """Set what the fork server inherits; it has to be there before it loads anything."""
    os.environ[EXECUTOR_VARIABLE] = executor
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")  # a run is one thread of one core


def _introduce(slots: int) -> WorkerInfo:
    host = socket.gethostname()
    safe = re.sub(r"[^A-Za-z0-9_-]", "-", host)[:_HOST_PART].lstrip("-_") or "host"
    name = f"{safe}-{os.getpid()}-{secrets.token_hex(2)}"
    return WorkerInfo(name, host, os.getpid(), version("scenario-tui"), slots, 0)


def _meet(link: Link, me: WorkerInfo) -> Welcome:
    try:
        return link.ask(Verb.WELCOME, me, Welcome)
    except Refused as error:
        raise WorkerBroken(str(error)) from error


def _reach(state: Path) -> Places:
    places = Places.find(state)
    try:
        if not state.is_dir():
            raise FileNotFoundError(f"there is no directory {state} on this machine")
        places.make()
    except OSError as error:
        raise WorkerBroken(
            f"this worker cannot use the daemon's state directory: {error}; workers share a file "
            "system with the daemon, name the directory's path here with --state"
        ) from error
    return places


def _log(message: str) -> None:
    now = datetime.now().astimezone().isoformat(timespec="milliseconds")
    # A full disk must not end a worker whose log lies there.
    with suppress(OSError):
        print(now, message, file=sys.stderr, flush=True)
