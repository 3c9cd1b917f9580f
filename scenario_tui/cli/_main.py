"""The command line as a whole: its commands, and what becomes of errors."""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Final

import typer

from grammars.diagnostics import InputError
from scenario_tui.cli import (
    _blame,
    _campaign,
    _compare,
    _control,
    _coverage,
    _doctor,
    _editor,
    _export,
    _fetch,
    _gc,
    _judge,
    _keys,
    _metrics,
    _plot,
    _reading,
    _replay,
    _report,
    _run,
    _services,
    _sut,
    _vary,
    _wait,
    _worker,
)
from scenario_tui.cli._exits import ExitCode
from scenario_tui.cli._help import Command, Group
from scenario_tui.cli._options import with_keys
from scenario_tui.cli._output import settle_streams

_PANELS: Final[dict[str, tuple[Callable[..., None], ...]]] = {
    "Run campaigns": (
        _campaign.demo,
        _campaign.check,
        _sut.sut,
        _campaign.run,
        _campaign.submit,
        _wait.wait,
    ),
    "Look": (
        _services.tui,
        _reading.status,
        _reading.results,
        _run.show,
        _run.logs,
        _fetch.fetch,
        _replay.replay,
        _plot.plot,
    ),
    "Understand": (
        _judge.judge,
        _compare.compare,
        _report.report,
        _coverage.coverage,
        _blame.blame,
    ),
    "Steer": (
        _control.cancel,
        _control.retry,
        _control.pause,
        _control.resume,
        _control.priority,
        _control.stop,
    ),
    "Machines": (_services.daemon, _worker.worker),
    "Operate": (_doctor.doctor, _metrics.metrics, _gc.gc),
    "Artefacts": (_export.export, _vary.vary),
    "Editors": (_editor.schema, _editor.vscode),
}

app = typer.Typer(
    name="scenario",
    help="Test mobile robots in scenarios: run campaigns in simulation, judge every run, "
    "see what happened.",
    epilog="Start with: scenario demo",
    cls=Group,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for _panel, _commands in _PANELS.items():
    for _command in _commands:
        app.command(rich_help_panel=_panel, cls=Command)(with_keys(_command))
app.add_typer(_keys.app, rich_help_panel="Machines")


def command_names() -> frozenset[str]:
    """Return the names of all commands."""
    commands = {command.__name__ for group in _PANELS.values() for command in group}
    return frozenset(commands | {"keys"})


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"scenario {version('scenario-tui')}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Say the version."),
    ] = False,
) -> None:
    """Test mobile robots in scenarios: run campaigns in simulation, judge every run."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave with its exit code."""
    settle_streams()
    code = invoke(sys.argv[1:] if arguments is None else arguments)
    try:
        sys.stdout.flush()
    except OSError as error:
        # Whoever read us has left (`scenario results | head`) or a disk is full: nothing more
        # can be said there.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = _unhandled(error)
    sys.exit(code)


def invoke(arguments: Sequence[str]) -> int:
    """Run the command line and return its exit code; every error has been reported."""
    try:
        return _called(app(args=list(arguments), prog_name="scenario", standalone_mode=False))
    except typer.TyperException as error:
        return _misused(error)
    except InputError as error:
        return _bad_input(error)
    except (KeyboardInterrupt, typer.Abort):
        return ExitCode.INTERRUPTED
    except SystemExit as left:
        return _left(left)
    except Exception as error:
        return _unhandled(error)


def _called(code: Any) -> int:
    return code if isinstance(code, int) else ExitCode.EXPECTED


def _left(left: SystemExit) -> int:
    """Commands leave with typer.Exit; what else leaves is typer itself."""
    # It asks shells by its code whether there is anything to complete; otherwise it and rich call
    # sys.exit(1) when a pipe is broken.
    if not left.code or "_SCENARIO_COMPLETE" in os.environ:
        return _called(left.code)
    return ExitCode.BROKEN_PIPE


def _misused(error: typer.TyperException) -> int:
    # Usage errors show themselves with the command they are about; the root has only its words.
    show: Callable[[], None] | None = getattr(error, "show", None)
    if show is not None:
        show()
    else:
        sys.stderr.write(f"{error}\n")
    return ExitCode.BAD_INPUT


def _bad_input(error: InputError) -> int:
    from scenario_tui.cli._diagnostics import counts, report
    from scenario_tui.cli._output import say

    report(error.diagnostics)
    say(counts(error.diagnostics))
    return ExitCode.BAD_INPUT


def _unhandled(error: Exception) -> int:
    from scenario_tui.cli._output import say

    if isinstance(error, BrokenPipeError):
        return ExitCode.BROKEN_PIPE
    from daemon.errors import DaemonError, Refused

    if isinstance(error, DaemonError):
        say(f"scenario: {error}")
        # A daemon that refuses is fine itself: it was asked for something that is not there.
        return ExitCode.BAD_INPUT if isinstance(error, Refused) else ExitCode.INFRASTRUCTURE
    if isinstance(error, OSError):
        where = f": {error.filename}" if error.filename else ""
        say(f"scenario: {error.strerror or error}{where}")
        return ExitCode.INFRASTRUCTURE
    say("".join(traceback.format_exception(error)).rstrip())
    say(f"scenario: {type(error).__name__}: {error}\nThis is a bug in scenario; please report it.")
    return ExitCode.BUG
