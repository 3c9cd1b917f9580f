"""The command line as a whole: its commands, how help shows them, and what becomes of errors."""

from __future__ import annotations

import errno
import gc
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import takewhile
from typing import Annotated, Any, Final

import typer

from grammars.text.diagnostics import InputError
from grammars.text.terminal_text import printable_streams
from scenario_tui.cli.commands import CommandGroup
from scenario_tui.cli.exit_codes import ExitCode
from scenario_tui.cli.interrupts import was_interrupted
from scenario_tui.cli.output import (
    COLLECT_RARELY,
    ErrorOutput,
    Output,
    report_diagnostics,
    say,
    settle_streams,
)
from scenario_tui.cli.plain_flags import load_help_pages

_COUNTS_ITS_OBJECTS: Final = "manifold3d"
"""Made with nanobind, which prints a list of all objects that are left when it is unloaded."""

_TYPED: Final = frozenset(
    {
        errno.ENAMETOOLONG, errno.ELOOP, errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.EEXIST,
        errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOTEMPTY,
    }
)  # fmt: skip
"""What is wrong with a path that somebody typed or wrote; no disk is at fault."""

app = typer.Typer(
    name="scenario",
    help="Test mobile robots in scenarios: run campaigns in simulation, judge every run, "
    "see what happened.",
    epilog="Start with: scenario demo, then scenario new my-tests",
    cls=CommandGroup,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


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
    # Before anything is written: the first message may already hold a sign the terminal lacks.
    settle_streams()
    # A command reads a lot, makes a lot of it and ends: looking for circles after every 700 new
    # objects took 3 to 7 % of exporting a campaign (ortega2024, six times in turns). Commands that
    # go on for hours set it back (stay_small).
    gc.set_threshold(*COLLECT_RARELY)
    code = invoke(sys.argv[1:] if arguments is None else arguments)
    if was_interrupted():
        code = ExitCode.INTERRUPTED  # also where a library has swallowed it
    try:
        sys.stdout.flush()
    except OSError as error:
        # Whoever read us has left (`scenario results | head`) or a disk is full: nothing more
        # can be said there.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code, _ = _report_unhandled(error)
    # The interpreter looks for circles once more when it ends, a sixth of the time of a check, to
    # give back what ends with the process anyway. One library complains if it does not.
    if _COUNTS_ITS_OBJECTS not in sys.modules:
        gc.freeze()
    sys.exit(code)


def invoke(arguments: Sequence[str]) -> int:
    """Run the command line and return its exit code; every error has been reported."""
    with printable_streams():
        return _invoke(arguments)


def _invoke(arguments: Sequence[str]) -> int:
    written, ErrorOutput.said = Output.emitted, ""
    code, answer = _call(arguments)
    # A command that has answered already leaves it at that: who reads it reads one object.
    if answer is not None and Output.emitted == written and _wants_json(arguments):
        with suppress(BrokenPipeError):
            answer.emit()
    return code


def _call(arguments: Sequence[str]) -> tuple[int, ErrorOutput | None]:
    """Call what was typed; returns the exit code, and what to write where there is no answer."""
    # Out of standalone mode typer raises instead of printing and leaving: the codes are ours, and
    # tests and the dashboard can call this.
    try:
        code = _exit_code_of(app(args=list(arguments), prog_name="scenario", standalone_mode=False))
        return code, ErrorOutput(
            ErrorOutput.said.removeprefix("scenario: "), code
        ) if code else None
    except (KeyboardInterrupt, typer.Abort):
        return ExitCode.INTERRUPTED, ErrorOutput("interrupted", ExitCode.INTERRUPTED)
    except SystemExit as left:
        return _typer_left(left), None
    except Exception as error:
        return _report(error)


def _wants_json(arguments: Sequence[str]) -> bool:
    """Whether --json was typed: what is typed wrongly is read by nobody who could say so."""
    return "--json" in takewhile(lambda word: word != "--", arguments)


def _report(error: Exception) -> tuple[int, ErrorOutput | None]:
    """Say what went wrong to people; returns the exit code, and the same for machines."""
    if isinstance(error, typer.TyperException):
        from scenario_tui.cli.usage_text import plain_words

        plain_words(error)
        code = _report_wrong_usage(error)
        return code, ErrorOutput(_usage_message(error), code)
    if isinstance(error, InputError):
        code = _report_bad_input(error)
        return code, ErrorOutput.of(error.findings, code)
    code, said = _report_unhandled(error)
    return code, ErrorOutput(said, code) if said else None


def _usage_message(error: typer.TyperException) -> str:
    message: Callable[[], str] | None = getattr(error, "format_message", None)
    return " ".join((message() if message is not None else str(error)).split())


def _exit_code_of(code: Any) -> int:
    return code if isinstance(code, int) else ExitCode.EXPECTED


def _typer_left(left: SystemExit) -> int:
    """Commands leave with typer.Exit; what else leaves is typer itself."""
    # It asks shells by its code whether there is anything to complete; otherwise it and rich call
    # sys.exit(1) when a pipe is broken.
    if not left.code or "_SCENARIO_COMPLETE" in os.environ:
        return _exit_code_of(left.code)
    return ExitCode.BROKEN_PIPE


def _report_wrong_usage(error: typer.TyperException) -> int:
    # Usage errors show themselves with the command they are about; the root has only its words.
    show: Callable[[], None] | None = getattr(error, "show", None)
    if show is not None:
        load_help_pages()
        show()
    else:
        sys.stderr.write(f"{error}\n")
    return ExitCode.BAD_INPUT


def _report_bad_input(error: InputError) -> int:
    from scenario_tui.text.diagnostics import diagnostic_counts

    report_diagnostics(error.findings)
    say(diagnostic_counts(error.findings))
    return ExitCode.BAD_INPUT


def _report_unhandled(error: Exception) -> tuple[int, str]:
    """Say what went wrong; returns the exit code and the same in one line, empty for nobody."""
    # A library that was interrupted while it loaded may raise anything.
    if was_interrupted():
        return ExitCode.INTERRUPTED, ""
    # Whoever left early knows why; a message would only tear at what is printed next.
    if isinstance(error, BrokenPipeError):
        return ExitCode.BROKEN_PIPE, ""
    from daemon.batch.errors import DaemonError, KeysUnusable, PlaceUnusable, Refused

    if isinstance(error, DaemonError):
        say(f"scenario: {error}")
        # A daemon that refuses is fine itself: it was asked for something that is not there. Keys
        # and places are what somebody named or wrote.
        typed = isinstance(error, Refused | KeysUnusable | PlaceUnusable)
        code = ExitCode.BAD_INPUT if typed else ExitCode.INFRASTRUCTURE
        return code, str(error)
    # A full disk, a folder that may not be written: not ours to mend, and no trace back helps.
    if isinstance(error, OSError):
        where = f": {error.filename}" if error.filename else ""
        said = f"{error.strerror or error}{where}"
        say(f"scenario: {said}")
        return (ExitCode.BAD_INPUT if error.errno in _TYPED else ExitCode.INFRASTRUCTURE), said
    say("".join(traceback.format_exception(error)).rstrip())
    said = f"{type(error).__name__}: {error}"
    say(f"scenario: {said}\nThis is a bug in scenario; please report it.")
    return ExitCode.BUG, f"a bug in scenario: {said}"
