"""The command that runs the daemon, or ends it."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from daemon.batch.amounts import parse_size
from daemon.batch.paths import endpoint_text
from daemon.model.execution import decide_on_commands
from scenario_tui.cli.answer import Answer
from scenario_tui.cli.options import parse_endpoint
from scenario_tui.cli.output import say
from scenario_tui.source import DaemonTarget

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


@dataclass(frozen=True, slots=True)
class LeavingDaemon:
    """A daemon that leaves with this many ``unfinished`` runs."""

    endpoint: str
    unfinished: int


def _parse_store(url: str) -> str:
    if not url:
        return ""
    from daemon.batch.stores import check_store_url

    return check_store_url(url)


def daemon(
    context: typer.Context,
    target: DaemonTarget,
    listen: Annotated[
        str,
        typer.Option(
            "--listen", metavar="ENDPOINT", parser=parse_endpoint,
            help="Where to listen for other machines, tls/host:port. Default: nowhere; this "
            "machine is served through the state directory.",
        ),
    ] = "",
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
    traces: Annotated[
        str,
        typer.Option(
            "--traces", metavar="URL", parser=_parse_store,
            help="Where traces of finished runs move to, file:///mnt/traces or s3://bucket/folder; "
            "credentials belong into the environment. Default: they stay in the state directory.",
        ),
    ] = "",
    quota: Annotated[
        int | None,
        typer.Option(
            "--quota", metavar="SIZE", envvar="SCENARIO_QUOTA", parser=parse_size,
            help="What traces may take in the state directory, 20GiB: then those of the oldest "
            "finished campaigns go. Default: no limit.",
        ),
    ] = None,
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
) -> Answer[LeavingDaemon] | None:  # fmt: skip
    """Run the daemon in the foreground, or end it.

    It keeps the queue and the results, and executes runs on this machine. --connect and --json go
    with --stop.
    """
    if end:
        leaving = _stop_daemon(target)
        return Answer("stop", leaving, partial(_print_leaving, leaving))
    for option, is_typed in (("--connect", target.connect), ("--json", "--json" in context.obj)):
        if is_typed:
            raise typer.BadParameter("goes with --stop only", param_hint=option)
    state = target.paths.state
    if print_unit:
        from daemon.batch.operation import daemon_unit

        has_quota = any(word.startswith("--quota") for word in context.obj)
        inherited = "" if has_quota else os.environ.get("SCENARIO_QUOTA", "")
        options = {"--state": str(state), "--quota": inherited}
        typer.echo(daemon_unit(unit_words(context, options)), nl=False)
        return None
    from daemon.batch.server import DaemonSettings, exposure_warning, serve

    # A warning only: refusing is the server's, which knows the keys it found.
    if warning := exposure_warning(listen):
        say(warning)
    decide_on_commands(commands, elsewhere=bool(listen))
    where = f" at {listen}" if listen else ""
    say(f"starting a daemon{where}, state in {state}, Ctrl-C to leave")
    settings = DaemonSettings(store=traces, quota=quota or 0)
    serve(state, listen=listen, insecure=insecure, slots=slots, settings=settings)
    say("the daemon has left; what is queued waits for the next one")
    return None


def unit_words(context: typer.Context, options: Mapping[str, str]) -> list[str]:
    """Return the command line of a unit: what was typed, with absolute paths.

    A unit has neither the variables of this shell nor its folder. So ``options`` that are not
    empty, and the folder of keys, take the place of typed ones.
    """
    keys = os.environ.get("SCENARIO_KEYS", "")
    options = {"--keys": str(Path(keys).absolute()) if keys else "", **options}
    values = {option: value for option, value in options.items() if value}
    typed, words = iter(context.obj), list[str]()
    for word in typed:
        option, equals, _ = word.partition("=")
        if option not in values:
            words += [word] if word != "--print-unit" else []
        elif not equals:
            next(typed)
    command, *rest = words
    pairs = [word for pair in values.items() for word in pair]
    beside = Path(sys.executable).with_name("scenario")
    executable = beside if beside.exists() else Path(sys.argv[0]).absolute()
    return [str(executable), command, *pairs, *rest]


def _stop_daemon(target: DaemonTarget) -> LeavingDaemon:
    # Asked first: once the daemon has left, nothing says where it was.
    endpoint = target.endpoint
    with target.open() as client:
        overview = client.overview()
        client.shutdown()
    return LeavingDaemon(endpoint, overview.queued + overview.running)


def _print_leaving(leaving: LeavingDaemon) -> None:
    count = leaving.unfinished
    rest = f"; {count} unfinished runs go on when it is started again" if count else ""
    say(f"the daemon at {endpoint_text(leaving.endpoint)} is leaving{rest}")
