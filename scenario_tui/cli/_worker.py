"""``scenario worker``: executes runs, on this machine or in a cluster."""

from __future__ import annotations

import os
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Final, TypeAlias

import typer

from daemon.executor import Limits, Scheduler
from scenario_tui.cli._amounts import duration, size
from scenario_tui.cli._options import Connect
from scenario_tui.cli._services import PrintUnit, executable

_TLS: Final = "--tls-ca, --tls-cert and --tls-key"


class Kind(StrEnum):
    """What executes the runs of a worker."""

    LOCAL = "local"
    DASK = "dask"


def _checked_scheduler(address: str) -> str:
    """Refuse what is no address of a Dask scheduler, as wrong usage."""
    protocol, _, rest = address.partition("://")
    if address and not (protocol in ("tcp", "tls") and rest.rpartition(":")[2].isdigit()):
        raise typer.BadParameter(f"{address!r} is no address, write tcp://<host>:<port> or tls://")
    return address


Certificate: TypeAlias = Path | None


def _file(name: str, what: str) -> object:
    return typer.Option(name, metavar="FILE", exists=True, dir_okay=False, help=what)


def worker(
    connect: Connect = "",
    slots: Annotated[
        int | None,
        typer.Option(
            "--slots", "-j", min=1, max=1024,
            help="Runs at a time. Default: one per core, or per thread of the cluster.",
        ),
    ] = None,
    backend: Annotated[
        Kind, typer.Option("--backend", help="What executes: this machine or a Dask cluster.")
    ] = Kind.LOCAL,
    scheduler: Annotated[
        str,
        typer.Option(
            "--scheduler", metavar="ADDRESS", callback=_checked_scheduler,
            help="The scheduler of the Dask cluster, tcp://host:8786 or tls://host:8786.",
        ),
    ] = "",
    tls_ca: Annotated[Certificate, _file("--tls-ca", "Who signed the scheduler's certificate.")]
    = None,
    tls_cert: Annotated[Certificate, _file("--tls-cert", "Our certificate for the scheduler.")]
    = None,
    tls_key: Annotated[Certificate, _file("--tls-key", "The key of our certificate.")] = None,
    memory: Annotated[
        str,
        typer.Option("--memory", metavar="SIZE", help="Address space of a run; 0B: no limit."),
    ] = "4GiB",
    wall: Annotated[
        str,
        typer.Option(
            "--wall", metavar="TIME",
            help="Wall clock limit of a run, 10min. Default: ten times its simulated limit, at "
            "least 5min.",
        ),
    ] = "",
    nice: Annotated[
        int | None,
        typer.Option(
            "--nice", min=0, max=19,
            help="How far this worker steps back behind whatever else runs here. Default: its "
            "runs by 10, itself not.",
        ),
    ] = None,
    state: Annotated[
        Path | None,
        typer.Option(
            "--state", metavar="DIR",
            help="The daemon's state directory, where this machine has it; elsewhere a folder for "
            "this worker. Default: the daemon's, then your user state folder.",
        ),
    ] = None,
    print_unit: PrintUnit = False,
) -> None:  # fmt: skip
    """Run a worker in the foreground.

    It executes runs of a daemon, on this machine, on another one or in a Dask cluster.
    """
    usual = Limits()
    limits = Limits(
        duration(wall) if wall else usual.wall, size(memory), usual.nice if nice is None else nice
    )
    cluster = _cluster(backend, scheduler, tls_ca, tls_cert, tls_key)
    if print_unit:
        _print_unit(connect, state, slots, limits, cluster)
        return
    from daemon.places import endpoint_text, find_endpoint
    from daemon.worker import work
    from scenario_tui.cli._output import say

    endpoint = find_endpoint(connect, state)
    where = endpoint_text(endpoint.address)
    say(f"worker for {where}, Ctrl-C to leave after the running runs")
    work(
        endpoint.address,
        slots=slots,
        state=state,
        limits=limits,
        scheduler=cluster,
        nice=nice or 0,
    )


def _cluster(
    backend: Kind, scheduler: str, ca: Path | None, certificate: Path | None, key: Path | None
) -> Scheduler | None:
    if backend is Kind.LOCAL:
        if scheduler or ca or certificate or key:
            raise typer.BadParameter(f"--scheduler, {_TLS} need --backend dask")
        return None
    if not scheduler:
        raise typer.BadParameter("--backend dask needs --scheduler tcp://<host>:<port>")
    if not scheduler.startswith("tls://") and (ca or certificate or key):
        raise typer.BadParameter(f"{_TLS} need --scheduler tls://<host>:<port>")
    return Scheduler(scheduler, ca, certificate, key)


def _print_unit(
    connect: str, state: Path | None, slots: int | None, limits: Limits, cluster: Scheduler | None
) -> None:
    """A unit has no variables of this shell: what they say is written into it."""
    from daemon.operation import worker_unit
    from daemon.places import Places, find_endpoint

    found = find_endpoint(connect, state)
    named = found.address if found.origin in ("--connect", "SCENARIO_CONNECT") else ""
    # Without an endpoint it is the state directory that says where the daemon is.
    told = state or os.environ.get("SCENARIO_STATE") or not named
    folder = Places.find(state).state if told else None
    options = [*_limit_options(limits), *_cluster_options(cluster), *_key_options()]
    unit = worker_unit(executable(), named, folder, slots, limits=limits, options=options)
    typer.echo(unit, nl=False)


def _limit_options(limits: Limits) -> Sequence[str]:
    usual = Limits()
    words = ["--memory", f"{limits.memory}B"] if limits.memory != usual.memory else []
    words += ["--wall", f"{limits.wall:g}s"] if limits.wall != usual.wall else []
    return words + (["--nice", str(limits.nice)] if limits.nice != usual.nice else [])


def _cluster_options(cluster: Scheduler | None) -> Sequence[str]:
    if cluster is None:
        return ()
    words = ["--backend", "dask", "--scheduler", cluster.address]
    files = {"ca": cluster.ca, "cert": cluster.certificate, "key": cluster.key}
    for name, path in files.items():
        words += [f"--tls-{name}", str(path.absolute())] if path else []
    return words


def _key_options() -> Sequence[str]:
    keys = os.environ.get("SCENARIO_KEYS")
    return ("--keys", str(Path(keys).absolute())) if keys else ()
