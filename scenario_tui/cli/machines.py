"""Commands that stay: the daemon and the worker."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from daemon.model.execution import RunLimits, decide_on_commands
from scenario_tui.cli.exit_codes import wrong_usage
from scenario_tui.cli.options import (
    AsJson,
    Connect,
    Keys,
    State,
    Wall,
    check_endpoint,
    read_size,
    read_wall,
    use_keys,
)
from scenario_tui.cli.output import say

Commands: TypeAlias = Annotated[
    bool | None,
    typer.Option(
        "--commands/--no-commands",
        help="Whether runs may start commands that stand in SUT files (kind ros2). Default: yes, "
        "unless runs come from other machines.",
    ),
]
PrintUnit: TypeAlias = Annotated[
    bool, typer.Option("--print-unit", help="Write a systemd user unit for this and leave.")
]


def _check_store(url: str) -> str:
    """Refuse what is no store, as wrong usage."""
    if url:
        from daemon.batch.stores import check_store_url

        with wrong_usage():
            return check_store_url(url)
    return url


def _check_size(text: str) -> str:
    """Refuse what is no size, as wrong usage."""
    if text:
        read_size(text)
    return text


def daemon(
    listen: Annotated[
        str,
        typer.Option(
            "--listen",
            metavar="ENDPOINT",
            callback=check_endpoint,
            help="Where to listen for other machines, tls/host:port. Default: nowhere; this "
            "machine is served through the state directory.",
        ),
    ] = "",
    keys: Keys = None,
    insecure: Annotated[
        bool,
        typer.Option("--insecure", help="Listen at plain tcp/ to the network, without any keys."),
    ] = False,
    slots: Annotated[
        int | None,
        typer.Option(
            "--slots", "-j", min=0, max=1024,
            help="Runs at a time on this machine; 0: none here. Default: one per core.",
        ),
    ] = None,
    state: State = None,
    traces: Annotated[
        str,
        typer.Option(
            "--traces", metavar="URL", callback=_check_store,
            help="Where traces of finished runs move to, file:///mnt/traces or s3://bucket/folder; "
            "credentials belong into the environment. Default: they stay in the state directory.",
        ),
    ] = "",
    quota: Annotated[
        str,
        typer.Option(
            "--quota", metavar="SIZE", envvar="SCENARIO_QUOTA", callback=_check_size,
            help="What traces may take in the state directory, 20GiB: then those of the oldest "
            "finished campaigns go. Default: no limit.",
        ),
    ] = "",
    commands: Commands = None,
    print_unit: PrintUnit = False,
    end: Annotated[
        bool,
        typer.Option(
            "--stop",
            help="Ask the daemon that runs to leave: running runs get a while to finish, what is "
            "queued goes on with the next daemon.",
        ),
    ] = False,
    connect: Connect = "",
    as_json: AsJson = False,
) -> None:  # fmt: skip
    """Run the daemon in the foreground, or end it.

    It keeps the queue and the results, and executes runs on this machine. --connect and --json go
    with --stop.
    """
    if end:
        use_keys(keys)
        from scenario_tui.cli.steer import stop_daemon
        from scenario_tui.cli.target import DaemonTarget

        stop_daemon(DaemonTarget(connect, state), as_json=as_json)
        return
    for option, given in (("--connect", bool(connect)), ("--json", as_json)):
        if given:
            raise typer.BadParameter("goes with --stop only", param_hint=option)
    from daemon.batch.paths import StatePaths
    from daemon.batch.server import DaemonSettings, exposure_warning, serve

    paths = StatePaths.find(state)
    if print_unit:
        from daemon.batch.operation import daemon_unit

        unit = daemon_unit(
            scenario_executable(), paths.state, listen, slots,
            keys=keys, insecure=insecure, traces=traces, quota=quota, commands=commands,
        )  # fmt: skip
        typer.echo(unit, nl=False)
        return
    # A warning only: refusing is the server's, which knows the keys it found.
    if words := exposure_warning(listen):
        say(words)
    decide_on_commands(commands, elsewhere=bool(listen))
    where = f" at {listen}" if listen else ""
    say(f"starting a daemon{where}, state in {paths.state}, Ctrl-C to leave")
    settings = DaemonSettings(store=traces, quota=read_size(quota) if quota else 0)
    serve(paths.state, listen=listen, keys=keys, insecure=insecure, slots=slots, settings=settings)
    say("the daemon has left; what is queued waits for the next one")


def scenario_executable() -> Path:
    """The ``scenario`` command of this installation."""
    import sys

    beside = Path(sys.executable).with_name("scenario")
    return beside if beside.exists() else Path(sys.argv[0]).absolute()


def _check_scheduler(address: str) -> str:
    """Refuse what is no address of a Dask scheduler, as wrong usage."""
    protocol, _, rest = address.partition("://")
    if address and not (protocol in ("tcp", "tls") and rest.rpartition(":")[2].isdigit()):
        raise typer.BadParameter(f"{address!r} is no address, write tcp://<host>:<port> or tls://")
    return address


def worker(
    connect: Connect = "",
    slots: Annotated[
        int | None,
        typer.Option(
            "--slots", "-j", min=1, max=1024,
            help="Runs at a time. Default: one per core, or per thread of the cluster.",
        ),
    ] = None,
    dask: Annotated[
        str,
        typer.Option(
            "--dask", metavar="ADDRESS", callback=_check_scheduler,
            help="Execute runs in the Dask cluster whose scheduler is at tcp://host:8786 or "
            "tls://host:8786, certificates as Dask is configured.",
        ),
    ] = "",
    memory: Annotated[
        str,
        typer.Option("--memory", metavar="SIZE", help="Address space of a run; 0B: no limit."),
    ] = "4GiB",
    wall: Wall = "",
    nice: Annotated[
        int | None,
        typer.Option(
            "--nice", min=0, max=19,
            help="How far this worker steps back behind whatever else runs here. Default: its "
            "runs by 10, itself not.",
        ),
    ] = None,
    state: State = None,
    commands: Commands = None,
    print_unit: PrintUnit = False,
) -> None:  # fmt: skip
    """Run a worker in the foreground.

    It executes runs of a daemon, on this machine, on another one or in a Dask cluster.
    """
    # Limits guard runs; how far the worker itself steps back is another matter, said to work().
    usual = RunLimits()
    limits = RunLimits(
        read_wall(wall) or usual.wall,
        read_size(memory),
        usual.nice if nice is None else nice,
    )
    if print_unit:
        _print_unit(connect, state, slots, limits, dask, commands)
        return
    from daemon.batch.paths import endpoint_text, find_endpoint
    from daemon.batch.worker import work

    endpoint = find_endpoint(connect, state)
    where = endpoint_text(endpoint.address)
    say(f"worker for {where}, Ctrl-C to leave after the running runs")
    from daemon.batch.errors import Unreachable

    try:
        work(
            endpoint.address,
            slots=slots,
            state=state,
            limits=limits,
            dask=dask,
            nice=nice or 0,
            commands=commands,
        )
    except Unreachable as error:
        # Only at its start, later it waits: what was typed is where no daemon is.
        if connect:
            raise typer.BadParameter(str(error), param_hint="--connect") from error
        raise


def _print_unit(
    connect: str,
    state: Path | None,
    slots: int | None,
    limits: RunLimits,
    dask: str,
    commands: bool | None,
) -> None:
    """A unit has no variables of this shell: what they say is written into it."""
    from daemon.batch.operation import worker_unit
    from daemon.batch.paths import StatePaths, find_endpoint

    found = find_endpoint(connect, state)
    named = found.address if found.origin in ("--connect", "SCENARIO_CONNECT") else ""
    # Without an endpoint it is the state directory that says where the daemon is.
    names_state = state or os.environ.get("SCENARIO_STATE") or not named
    folder = StatePaths.find(state).state if names_state else None
    options = [*_limit_options(limits), *_key_options()]
    options += ["--dask", dask] if dask else []
    options += [] if commands is None else ["--commands" if commands else "--no-commands"]
    unit = worker_unit(scenario_executable(), named, folder, slots, limits=limits, options=options)
    typer.echo(unit, nl=False)


def _limit_options(limits: RunLimits) -> Sequence[str]:
    usual = RunLimits()
    # Only what differs from the usual: a unit that names a default would keep it for ever.
    words = ["--memory", f"{limits.memory}B"] if limits.memory != usual.memory else []
    words += ["--wall", f"{limits.wall:g}s"] if limits.wall != usual.wall else []
    return words + (["--nice", str(limits.nice)] if limits.nice != usual.nice else [])


def _key_options() -> Sequence[str]:
    keys = os.environ.get("SCENARIO_KEYS")
    return ("--keys", str(Path(keys).absolute())) if keys else ()
