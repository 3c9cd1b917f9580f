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
from daemon.executor import DEFAULT_EXECUTOR, Limits, Scheduler, cores
from daemon.messages import ALIVE, WORK, Verb, Welcome, WorkerInfo
from daemon.places import is_encrypted
from daemon.security import Role, find_holder
from daemon.worker._agent import Agent, Link
from daemon.worker._backend import Backend
from daemon.worker._base import settle
from daemon.worker._children import Nursery
from daemon.worker._environment import prepare_environment, step_back
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
    keys: Path | None = None,
    tether: bool = False,
    scheduler: Scheduler | None = None,
    nice: int = 0,
) -> None:
    """Execute runs of the daemon at ``connect`` until told to leave.

    ``slots`` runs at a time (``None``: one per core, or per thread of the Dask cluster that
    executes them if there is a ``scheduler``). Where the daemon's state directory can be reached,
    under the path it says or as ``state``, spool and traces lie there. Elsewhere the worker has a
    folder of its own, in ``state`` or the user's state folder, and sends traces.
    ``executor`` (``module:function``) executes runs and is never taken from the network. With
    ``parent`` the worker finishes and leaves when that process is not its parent any more; with
    ``tether`` it dies when its standard input closes. With ``nice`` the session it leads steps
    back behind others, not only each run behind the worker. To be called from the main thread.

    SIGTERM or SIGINT: finish what runs, then leave. A second one, or SIGQUIT: give it back.

    Raises :class:`daemon.errors.Unreachable` when no daemon answers at the start and
    :class:`WorkerBroken` when runs cannot be executed here.
    """
    if tether:
        hold_tether()
    if nice:
        step_back(nice)
    me = _introduce()
    with ExitStack() as stack:
        orders = Orders(parent=parent)
        stack.callback(orders.close)
        stack.enter_context(orders.signals())
        backend = _backend(slots, executor, scheduler, stack)
        holder = find_holder(Role.WORKER, keys) if is_encrypted(connect) else None
        session = stack.enter_context(bus.open_client(connect, holder))
        link = Link(session, connect, holder)
        welcome = _meet(link, me)
        base = settle(state, welcome)
        spool = Spool(base.places, me.id)
        stack.callback(spool.close)
        stack.enter_context(session.liveliness().declare_token(f"{ALIVE}/{me.id}"))
        stack.enter_context(session.declare_subscriber(WORK, lambda _: orders.hint()))
        agent = Agent(
            link,
            lambda busy: replace(me, busy=busy, slots=backend.slots),
            base,
            spool,
            backend,
            orders,
            limits=limits or Limits(),
            renew=welcome.renew,
            log=_log,
        )
        _log(f"{me.id} works for {connect} with {backend.slots} slots in {base.places.state}")
        agent.run()
        _log(f"{me.id} leaves")


def _backend(
    slots: int | None, executor: str, scheduler: Scheduler | None, stack: ExitStack
) -> Backend:
    """What executes runs, proven to; raises :class:`WorkerBroken`."""
    if scheduler is None:
        prepare_environment(executor)
        nursery = Nursery(cores() if slots is None else slots)
        nursery.prove()
        return nursery
    try:
        from daemon.worker.cluster import Gateway
    except ImportError as error:
        raise WorkerBroken(
            f"a Dask cluster needs the extra: pip install 'scenario-tui[dask]' ({error})"
        ) from error
    gateway = Gateway(scheduler, executor, slots=slots, log=_log)
    stack.callback(gateway.close)
    gateway.open()
    return gateway


def _introduce() -> WorkerInfo:
    host = socket.gethostname()
    safe = re.sub(r"[^A-Za-z0-9_-]", "-", host)[:_HOST_PART].lstrip("-_") or "host"
    name = f"{safe}-{os.getpid()}-{secrets.token_hex(2)}"
    return WorkerInfo(name, host, os.getpid(), version("scenario-tui"), 0, 0)


def _meet(link: Link, me: WorkerInfo) -> Welcome:
    try:
        return link.ask(Verb.WELCOME, me, Welcome)
    except Refused as error:
        raise WorkerBroken(str(error)) from error


def _log(message: str) -> None:
    now = datetime.now().astimezone().isoformat(timespec="milliseconds")
    # A full disk must not end a worker whose log lies there.
    with suppress(OSError):
        print(now, message, file=sys.stderr, flush=True)
