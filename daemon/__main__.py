"""``python -m daemon serve|worker``: the processes behind the ``scenario`` command."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Final

from daemon.batch.amounts import QUOTA_VARIABLE, parse_size
from daemon.batch.errors import (
    EXIT_ALREADY_RUNNING,
    EXIT_BROKEN,
    EXIT_FAILED,
    AlreadyRunning,
    DaemonError,
    WorkerBroken,
)
from daemon.model.execution import DEFAULT_EXECUTOR, RunLimits
from grammars.text.terminal_text import printable_streams

_SETTINGS: Final = {"lease": float, "attempts": int, "patience": float}


def main() -> int:
    """Parse the command line and run the chosen process."""
    with printable_streams():
        options = _parser().parse_args()
        try:
            options.run(options)
        except DaemonError as error:
            print(error, file=sys.stderr)
            if isinstance(error, AlreadyRunning):
                return EXIT_ALREADY_RUNNING
            return EXIT_BROKEN if isinstance(error, WorkerBroken) else EXIT_FAILED
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m daemon")
    commands = parser.add_subparsers(required=True)
    serve = commands.add_parser("serve", help="run the daemon")
    serve.set_defaults(run=_serve)
    serve.add_argument("--state", type=Path, required=True)
    serve.add_argument("--listen", default="")
    serve.add_argument("--insecure", action="store_true")
    serve.add_argument("--traces", default="")
    serve.add_argument("--quota", default=os.environ.get(QUOTA_VARIABLE, ""))
    # Their defaults are those of DaemonSettings, which only a daemon loads (Zenoh, the ledger).
    for name, kind in _SETTINGS.items():
        serve.add_argument(f"--{name}", type=kind)
    worker = commands.add_parser("worker", help="run a worker")
    worker.set_defaults(run=_work)
    worker.add_argument("--connect", required=True)
    worker.add_argument("--state", type=Path)
    worker.add_argument("--parent", type=int, default=0)
    worker.add_argument("--dask", default="")
    worker.add_argument("--step-back", type=int, default=0)
    for command in (serve, worker):
        command.add_argument("--slots", type=int)
        command.add_argument("--keys", type=Path)
        command.add_argument("--executor", default=DEFAULT_EXECUTOR)
        command.add_argument("--tether", action="store_true")
        command.add_argument("--wall", type=float, default=RunLimits().wall)
        command.add_argument("--memory", type=int, default=RunLimits().memory)
        command.add_argument("--nice", type=int, default=RunLimits().nice)
    return parser


def _serve(options: argparse.Namespace) -> None:
    from daemon.batch.server import DaemonSettings, serve

    try:
        quota = parse_size(options.quota) if options.quota else 0
    except ValueError as error:
        raise DaemonError(f"the quota of traces: {error}") from error
    given = {name: getattr(options, name) for name in _SETTINGS}
    chosen = {name: value for name, value in given.items() if value is not None}
    serve(
        options.state,
        listen=options.listen,
        keys=options.keys,
        insecure=options.insecure,
        slots=options.slots,
        settings=DaemonSettings(store=options.traces, quota=quota, **chosen),
        executor=options.executor,
        limits=RunLimits(options.wall, options.memory, options.nice),
        tether=options.tether,
    )


def _work(options: argparse.Namespace) -> None:
    from daemon.batch.worker import work

    work(
        options.connect,
        slots=options.slots,
        state=options.state,
        executor=options.executor,
        limits=RunLimits(options.wall, options.memory, options.nice),
        parent=options.parent,
        keys=options.keys,
        tether=options.tether,
        dask=options.dask,
        nice=options.step_back,
    )


if __name__ == "__main__":
    sys.exit(main())
