"""The command that opens the dashboard."""

from __future__ import annotations

import gc
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from typing import Annotated, Final

import typer

from grammars.text.terminal_text import unfiltered
from scenario_tui.cli.answer import CommandError, ExitCode
from scenario_tui.cli.options import refuse_typed
from scenario_tui.cli.output import plain_table, say, stdout_console
from scenario_tui.dashboard.config import Config, config_path, read_config
from scenario_tui.source import DaemonTarget
from scenario_tui.terminal.capabilities import why_no_screen

_COLLECT: Final = 10_000
"""New objects between two garbage collections: Python's 700 take a fifth of a key's time."""
_SERVED: Final = "TEXTUAL_DRIVER"
"""Variable that textual-serve sets for a dashboard in a browser."""


def tui(
    context: typer.Context,
    target: DaemonTarget,
    read_only: Annotated[bool, "Only look: the dashboard changes nothing."] = False,
    bindings: Annotated[bool, "List the ids of all keys for config.toml, and exit."] = False,
    web: Annotated[bool, "Show it in browsers of this machine, read-only."] = False,
    write: Annotated[bool, "With --web: allow changes from browsers."] = False,
    port: Annotated[
        int, typer.Option(min=1, max=65535, help="With --web: port of the page.")
    ] = 8000,
    public_url: Annotated[
        str,
        typer.Option(
            metavar="URL", help="With --web: address at which your proxy shows it to others."
        ),
    ] = "",
) -> int | None:
    """Open the dashboard; leaving it never stops any work.

    If no daemon answers, one is started on this machine, unless --read-only or --connect is given.
    With --web, browsers show it until Ctrl-C; each page has its own dashboard.
    Keys, colours and more are set in config.toml; `scenario doctor` prints its path.
    """
    if bindings:
        _print_bindings()
        return None
    if web:
        _serve(target, port, public_url, may_write=write and not read_only)
        return None
    refuse_typed(context, ("write", "port", "public_url"), "needs --web")
    served = _SERVED in os.environ
    if served:
        from daemon.supervision.child import die_with_parent

        die_with_parent(os.getppid())
    gc.set_threshold(_COLLECT)
    why = "" if served else why_no_screen()
    with nullcontext() if why or served else _connecting_screen():
        from scenario_tui.dashboard.app import run_dashboard

        config = _read_config()
        if why:
            raise CommandError(
                f"the dashboard needs a terminal: {why} (scripts: `scenario status --json`)"
            )
        # The option can only take rights away: the file may forbid changes for good.
        config = replace(config, read_only=config.read_only or read_only)
        launch = None if target.named or config.read_only else partial(_launch_daemon, target)
        code, farewell = run_dashboard(target, config, launch)
    if code:
        return ExitCode.BUG
    if not served:
        say(farewell)
    return None


def _read_config() -> Config:
    from scenario_tui.dashboard.key_bindings import check_config

    config = read_config()
    check_config(config)
    return config


def _serve(target: DaemonTarget, port: int, public_url: str, *, may_write: bool) -> None:
    """Serve the dashboard to browsers until Ctrl-C."""
    from daemon.model.execution import python_command
    from grammars.text.plugins import load_extra

    load_extra("textual_serve.server", "web", "a dashboard in the browser", "--web")
    from scenario_tui.dashboard.web import DashboardServer

    config = _read_config()  # report its errors here, not in each page
    may_write = may_write and not config.read_only
    if public_url and not re.fullmatch(r"https?://[^/?#\s]+(/[^?#\s]*)?", public_url):
        message = f"{public_url!r} is not an address such as https://lab.example/scenario"
        raise typer.BadParameter(message, param_hint="--public-url")
    words = (*target.words, *(() if may_write else ("--read-only",)))
    command = python_command("-c", "from scenario_tui.cli import main; main()", "tui", *words)
    server = DashboardServer(command, port, public_url)
    rights = "" if may_write else ", read-only"
    behind = f" (for your proxy: http://127.0.0.1:{port}/)" if public_url else ""
    try:
        server.serve_until_stopped(
            lambda: say(f"the dashboard is at {server.address}{behind}{rights}; Ctrl-C ends it")
        )
    except OSError as error:
        why = f"port {port} cannot be used: {error.strerror}; choose another with --port"
        raise CommandError(why) from error


def _launch_daemon(target: DaemonTarget) -> str:
    """Start the daemon of this machine if none answers; return a message about it."""
    # Imported here, in a thread of the dashboard, which opens before.
    from scenario_tui.library.job import launch_daemon

    return launch_daemon(target)


@contextmanager
def _connecting_screen() -> Iterator[None]:
    """Show a screen at once, because the libraries of the dashboard take a while to load.

    The dashboard takes over the screen and restores it at its end; so does an error before.
    """

    def write(text: str) -> None:
        stream = unfiltered(sys.stderr)
        stream.write(text)
        stream.flush()

    try:
        # Alternate screen, no cursor, cleared; first line, second column.
        write("\x1b[?1049h\x1b[?25l\x1b[2J\x1b[1;2H... connecting")
        yield
    except BaseException:
        write("\x1b[?1049l\x1b[?25h")
        raise


def _print_bindings() -> None:
    """Print a line for each binding: its id, its keys, its screens, its meaning."""
    from scenario_tui.dashboard.key_bindings import list_key_bindings

    table = plain_table("id", "keys", "where", "what it does")
    for bound in list_key_bindings():
        table.add_row(bound.id, bound.keys.replace(",", " "), bound.place, bound.meaning)
    stdout_console().print(table)
    typer.echo(f'\nTo change them, write below [keys] in {config_path()}: id = "key"')
