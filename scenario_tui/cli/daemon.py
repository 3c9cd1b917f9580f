"""The command that runs the daemon, or stops it."""

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
        help="Let runs start the commands in SUT files (kind ros2). Default: yes, unless runs come "
        "from other machines.",
    ),
]
PrintUnit: TypeAlias = Annotated[bool, "Print a systemd user unit for this command and exit."]


@dataclass(frozen=True, slots=True)
class LeavingDaemon:
    """A daemon that stops, with the number of ``unfinished`` runs."""

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
            help="Endpoint for other machines, tls/host:port. Default: none; this machine "
            "connects through the state directory.",
        ),
    ] = "",
    insecure: Annotated[bool, "Listen to the network on plain tcp/, without any keys."] = False,
    slots: Annotated[
        int | None,
        typer.Option(
            "--slots", "-j", min=0, max=1024,
            help="Parallel runs on this machine; 0 for none. Default: one per core.",
        ),
    ] = None,
    traces: Annotated[
        str,
        typer.Option(
            "--traces", metavar="URL", parser=_parse_store,
            help="Store for traces of finished runs, file:///mnt/traces or s3://bucket/folder; "
            "credentials come from the environment. Default: the state directory.",
        ),
    ] = "",
    quota: Annotated[
        int | None,
        typer.Option(
            "--quota", metavar="SIZE", envvar="SCENARIO_QUOTA", parser=parse_size,
            help="Space for traces in the state directory, such as 20GiB; beyond it, traces of the "
            "oldest finished campaigns are removed. Default: no limit.",
        ),
    ] = None,
    commands: Commands = None,
    print_unit: PrintUnit = False,
    end: Annotated[
        bool,
        "--stop",
        "Stop the running daemon: runs get a while to finish; the next daemon continues with the "
        "queue.",
    ] = False,
) -> Answer[LeavingDaemon] | None:  # fmt: skip
    """Run the daemon in the foreground, or stop it.

    It keeps the queue and the results, and executes runs on this machine. --connect and --json
    belong to --stop.
    """
    if end:
        leaving = _stop_daemon(target)
        return Answer("stop", leaving, partial(_print_leaving, leaving))
    for option, is_typed in (("--connect", target.connect), ("--json", "--json" in context.obj)):
        if is_typed:
            raise typer.BadParameter("goes with --stop only", param_hint=option)
    state = target.paths.state
    if print_unit:
        from daemon.batch.systemd import daemon_unit

        has_quota = any(word.startswith("--quota") for word in context.obj)
        inherited = "" if has_quota else os.environ.get("SCENARIO_QUOTA", "")
        options = {"--state": str(state), "--quota": inherited}
        typer.echo(daemon_unit(unit_words(context, options)), nl=False)
        return None
    from daemon.batch.server import DaemonSettings, exposure_warning, serve

    # Only a warning: the server knows its keys, and refuses if they are missing.
    if warning := exposure_warning(listen):
        say(warning)
    decide_on_commands(commands, is_remote=bool(listen))
    where = f" at {listen}" if listen else ""
    say(f"starting a daemon{where}, state in {state}, Ctrl-C to leave")
    settings = DaemonSettings(store=traces, quota=quota or 0)
    serve(state, listen=listen, insecure=insecure, slots=slots, settings=settings)
    say("the daemon has stopped; queued runs wait for the next one")
    return None


def unit_words(context: typer.Context, options: Mapping[str, str]) -> list[str]:
    """Return the command line of a unit: the typed words, with absolute paths.

    A unit has neither the variables of this shell nor its folder. Therefore ``options`` that are
    not empty, and the folder of keys, replace typed ones.
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
    # First: the state directory does not know the endpoint of a daemon that has stopped.
    endpoint = target.endpoint
    with target.open() as client:
        overview = client.overview()
        client.shutdown()
    return LeavingDaemon(endpoint, overview.queued + overview.running)


def _print_leaving(leaving: LeavingDaemon) -> None:
    count = leaving.unfinished
    rest = f"; {count} unfinished runs continue with the next daemon" if count else ""
    say(f"the daemon at {endpoint_text(leaving.endpoint)} is stopping{rest}")
