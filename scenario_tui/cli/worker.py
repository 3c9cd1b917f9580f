"""The command that executes runs of a daemon, on this machine or in a Dask cluster."""

from __future__ import annotations

import os
from typing import Annotated

import typer

from daemon.batch.amounts import parse_size
from daemon.batch.errors import Unreachable
from daemon.batch.paths import endpoint_text, find_endpoint
from daemon.model.execution import RunLimits
from scenario_tui.cli.daemon import Commands, PrintUnit, unit_words
from scenario_tui.cli.options import Wall
from scenario_tui.cli.output import say
from scenario_tui.source import DaemonTarget


def _parse_scheduler(address: str) -> str:
    """Return the address of a Dask scheduler; raises ``ValueError``."""
    protocol, _, rest = address.partition("://")
    if address and not (protocol in ("tcp", "tls") and rest.rpartition(":")[2].isdigit()):
        raise ValueError(f"{address!r} is not an address: write tcp://<host>:<port> or tls://")
    return address


def worker(
    context: typer.Context,
    target: DaemonTarget,
    slots: Annotated[
        int | None,
        typer.Option(
            "--slots", "-j", min=1, max=1024,
            help="Parallel runs. Default: one per core, or per thread of the cluster.",
        ),
    ] = None,
    dask: Annotated[
        str,
        typer.Option(
            "--dask", metavar="ADDRESS", parser=_parse_scheduler,
            help="Execute runs in the Dask cluster with the scheduler at tcp://host:8786 or "
            "tls://host:8786, with the certificates of Dask's configuration.",
        ),
    ] = "",
    memory: Annotated[
        int | None,
        typer.Option(
            "--memory", metavar="SIZE", parser=parse_size,
            help="Address space of a run; 0B for no limit. Default: 4GiB.",
        ),
    ] = None,
    wall: Wall = None,
    nice: Annotated[
        int | None,
        typer.Option(
            "--nice", min=0, max=19,
            help="Nice value of this worker and its runs. Default: 0 for the worker, 10 for its "
            "runs.",
        ),
    ] = None,
    commands: Commands = None,
    print_unit: PrintUnit = False,
) -> None:  # fmt: skip
    """Run a worker in the foreground.

    It executes runs of a daemon, on this machine, on another one or in a Dask cluster.
    """
    # The limits are those of runs; the worker's own nice value goes to work().
    usual = RunLimits()
    limits = RunLimits(
        wall or usual.wall,
        usual.memory if memory is None else memory,
        usual.nice if nice is None else nice,
    )
    endpoint = find_endpoint(target.connect, target.state)
    if print_unit:
        from daemon.batch.systemd import worker_unit

        inherited = endpoint.address if endpoint.origin == "SCENARIO_CONNECT" else ""
        # Without an endpoint, the state directory leads to the daemon.
        names_state = target.state or os.environ.get("SCENARIO_STATE") or not target.named
        state = str(target.paths.state) if names_state else ""
        words = unit_words(context, {"--connect": inherited, "--state": state})
        typer.echo(worker_unit(words, limits), nl=False)
        return
    from daemon.batch.worker import work

    say(f"worker for {endpoint_text(endpoint.address)}, Ctrl-C to leave after the running runs")
    try:
        work(
            endpoint.address,
            slots=slots,
            state=target.state,
            limits=limits,
            dask=dask,
            nice=nice or 0,
            commands=commands,
        )
    except Unreachable as error:
        # Raised only at the start, later the worker waits: no daemon is at the typed endpoint.
        if target.connect:
            raise typer.BadParameter(str(error), param_hint="--connect") from error
        raise
