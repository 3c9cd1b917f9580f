"""Commands that stay: daemon and tui."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from scenario_tui.cli._exits import ExitCode
from scenario_tui.cli._options import Connect, Keys, State, checked_endpoint

PrintUnit: TypeAlias = Annotated[
    bool, typer.Option("--print-unit", help="Write a systemd user unit for this and leave.")
]


def _checked_store(url: str) -> str:
    """Refuse what is no store, as wrong usage."""
    if url:
        from daemon.store import checked_store

        try:
            return checked_store(url)
        except ValueError as error:
            raise typer.BadParameter(str(error)) from error
    return url


def _checked_size(text: str) -> str:
    """Refuse what is no size, as wrong usage."""
    if text:
        from scenario_tui.cli._amounts import size

        size(text)
    return text


def daemon(
    listen: Annotated[
        str,
        typer.Option(
            "--listen",
            metavar="ENDPOINT",
            callback=checked_endpoint,
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
            "--traces", metavar="URL", callback=_checked_store,
            help="Where workers put traces, file:///mnt/shared/traces or s3://bucket/folder; "
            "they need credentials in their environment. Default: the state directory.",
        ),
    ] = "",
    quota: Annotated[
        str,
        typer.Option(
            "--quota", metavar="SIZE", envvar="SCENARIO_QUOTA", callback=_checked_size,
            help="What traces may take in the state directory, 20GiB: then those of the oldest "
            "finished campaigns go. Default: no limit.",
        ),
    ] = "",
    print_unit: PrintUnit = False,
) -> None:  # fmt: skip
    """Run the daemon in the foreground.

    It keeps the queue and the results, and executes runs on this machine.
    """
    from daemon.places import Places
    from daemon.server import Settings, exposure, serve
    from scenario_tui.cli._amounts import size
    from scenario_tui.cli._output import say

    places = Places.find(state)
    if print_unit:
        from daemon.operation import daemon_unit

        unit = daemon_unit(
            executable(), places.state, listen, slots,
            keys=keys, insecure=insecure, traces=traces, quota=quota,
        )  # fmt: skip
        typer.echo(unit, nl=False)
        return
    if words := exposure(listen):
        say(words)
    where = f" at {listen}" if listen else ""
    say(f"starting a daemon{where}, state in {places.state}, Ctrl-C to leave")
    settings = Settings(store=traces, quota=size(quota) if quota else 0)
    serve(places.state, listen=listen, keys=keys, insecure=insecure, slots=slots, settings=settings)
    say("the daemon has left; what is queued waits for the next one")


def executable() -> Path:
    """The ``scenario`` command of this installation."""
    import sys

    beside = Path(sys.executable).with_name("scenario")
    return beside if beside.exists() else Path(sys.argv[0]).absolute()


def tui(
    connect: Connect = "",
    state: State = None,
    read_only: Annotated[
        bool, typer.Option("--read-only", help="Look only: nothing can be changed from it.")
    ] = False,
    bindings: Annotated[
        bool,
        typer.Option("--bindings", help="List the ids of all keys, for config.toml, and leave."),
    ] = False,
) -> None:
    """Open the dashboard; leaving it never stops any work.

    Keys, colours and more are set in config.toml; `scenario doctor` says where it is.
    """
    from scenario_tui.cli._output import say

    if bindings:
        _print_bindings()
        return
    why = _unfit()
    with nullcontext() if why else _curtain():
        from dataclasses import replace

        from scenario_tui.app import run_dashboard
        from scenario_tui.bindings import check_config
        from scenario_tui.cli._session import Target
        from scenario_tui.config import read_config
        from scenario_tui.equivalent import Equivalent

        config = read_config()
        check_config(config)
    if why:
        say(f"scenario: {why}")
        raise typer.Exit(ExitCode.BAD_INPUT)
    config = replace(config, read_only=config.read_only or read_only)
    equivalent = Equivalent(connect, state)
    code, farewell = run_dashboard(Target(connect, state).open, config, equivalent)
    if code:
        raise typer.Exit(ExitCode.BUG)
    say(farewell)


def _unfit() -> str:
    """Say why there can be no dashboard here, empty when there can."""
    import sys

    from scenario_tui.limits import undrawable

    # The dashboard is drawn on standard error, so that standard output stays for words.
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return "the dashboard needs a terminal; scripts use `scenario status --json`"
    return undrawable()


@contextmanager
def _curtain() -> Iterator[None]:
    """Answer at once: the libraries of the dashboard take several times as long as this line."""
    import sys

    def write(text: str) -> None:
        sys.stderr.write(text)
        sys.stderr.flush()

    write("\x1b[?1049h\x1b[?25l\x1b[2J\x1b[1;2H... connecting")
    try:
        yield
    except BaseException:
        write("\x1b[?1049l\x1b[?25h")
        raise


def _print_bindings() -> None:
    """One line per binding: its id, its keys, where it works, what it does."""
    from rich import box
    from rich.table import Table

    from scenario_tui.bindings import catalogue
    from scenario_tui.cli._output import out
    from scenario_tui.config import config_path

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for title in ("id", "keys", "where", "what it does"):
        table.add_column(title, overflow="fold")
    for bound in catalogue():
        table.add_row(bound.id, bound.keys.replace(",", " "), bound.place, bound.meaning)
    console = out()
    console.print(table)
    console.print(f'\nTo change them, write below [keys] in {config_path()}: id = "key"',
                  markup=False, soft_wrap=True)  # fmt: skip
