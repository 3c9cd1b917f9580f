"""The command line as a whole: its options, its exit codes, and the report of errors."""

from __future__ import annotations

import atexit
import errno
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import takewhile
from typing import Annotated, Final

import typer

from grammars.text.diagnostics import InputError, Severity
from grammars.text.terminal_text import printable_streams
from scenario_tui.cli.answer import CommandError, ErrorValue, ExitCode, write_json
from scenario_tui.cli.commands import CommandGroup
from scenario_tui.cli.output import library_messages, report_findings, say, settle_streams
from scenario_tui.interrupts import was_interrupted

_TYPED: Final = frozenset(
    {
        errno.ENAMETOOLONG, errno.ELOOP, errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.EEXIST,
        errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOTEMPTY,
    }
)  # fmt: skip
"""Errors of a path that a person typed or wrote; no disk is at fault."""

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


def _print_version(is_requested: bool) -> None:
    if is_requested:
        from importlib.metadata import version

        typer.echo(f"scenario {version('scenario-tui')}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    """Test mobile robots in scenarios: run campaigns in simulation, judge every run."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave with its exit code."""
    # First: any message may hold a character that the terminal lacks.
    settle_streams()
    code = invoke(sys.argv[1:] if arguments is None else arguments)
    if was_interrupted():
        code = ExitCode.INTERRUPTED  # even if a library has swallowed the interrupt
    try:
        sys.stdout.flush()
    except OSError as error:
        # The reader has left (`scenario results | head`) or a disk is full: the stream takes no
        # more output.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = _unhandled(error).exit_code
    # Not by sys.exit: a thread of the dashboard may still wait for an answer, and Zenoh aborts the
    # process if one comes while the interpreter ends.
    atexit._run_exitfuncs()
    os._exit(code)


def invoke(arguments: Sequence[str]) -> int:
    """Run the command line and return its exit code; every error has been reported."""
    # Outside of standalone mode typer raises instead of printing and leaving: the exit codes are
    # ours, and tests and the dashboard can call this function.
    with printable_streams(), library_messages():
        try:
            typed = list(arguments)
            code = app(args=typed, prog_name="scenario", standalone_mode=False, obj=typed)
            return code if isinstance(code, int) else ExitCode.EXPECTED
        except (KeyboardInterrupt, typer.Abort):
            failure = ErrorValue("interrupted", ExitCode.INTERRUPTED)
        except SystemExit as leaving:
            return _typer_left(leaving)
        except Exception as error:
            failure = _report(error)
        # Typer may have failed before it came to --json, so look for the word itself.
        if failure.error and "--json" in takewhile(lambda word: word != "--", arguments):
            with suppress(BrokenPipeError):
                write_json("error", failure)
        return failure.exit_code


def _typer_left(leaving: SystemExit) -> int:
    """Return the exit code when typer itself leaves; commands leave by ``typer.Exit``."""
    # Its code tells shells whether there is anything to complete; otherwise typer and rich call
    # sys.exit(1) when a pipe is broken.
    if not leaving.code or "_SCENARIO_COMPLETE" in os.environ:
        return leaving.code if isinstance(leaving.code, int) else ExitCode.EXPECTED
    return ExitCode.BROKEN_PIPE


def _report(error: Exception) -> ErrorValue:
    """Report an error to people; return it for machines."""
    if isinstance(error, typer.TyperException):
        return _wrong_usage(error)
    if isinstance(error, InputError):
        return _bad_input(error)
    failure = _unhandled(error)
    if failure.error:
        say(f"scenario: {failure.error}")
    return failure


def _wrong_usage(error: typer.TyperException) -> ErrorValue:
    # The prefix that pydantic puts before the message of a validator.
    error.message = error.message.replace("Value error, ", "")
    name, context = getattr(error, "option_name", "").lstrip("-"), getattr(error, "ctx", None)
    parameters = context.command.params if name and context else ()
    if any(getattr(one, "metavar", "") == "CAMPAIGN.yaml" for one in parameters):
        from daemon.campaign import CampaignFile

        if name in CampaignFile.model_fields:
            error.message += f'; "{name}:" is a key of the campaign file'
    # Usage errors print themselves with their command; other typer errors have only a message.
    show: Callable[[], None] | None = getattr(error, "show", None)
    if show is not None:
        show()
    else:
        sys.stderr.write(f"{error}\n")
    return ErrorValue(" ".join(error.format_message().split()), ExitCode.BAD_INPUT)


def _bad_input(error: InputError) -> ErrorValue:
    from scenario_tui.text.diagnostics import diagnostic_counts

    report_findings(error.findings)
    say(diagnostic_counts(error.findings))
    errors = [one for one in error.findings if one.severity is Severity.ERROR] or error.findings
    message = f"{errors[0].where}: {errors[0].message}" if errors else ""
    more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
    return ErrorValue(message + more, ExitCode.BAD_INPUT, error.findings)


def _unhandled(error: Exception) -> ErrorValue:
    """Return the exit code, with a message unless the user caused the end."""
    if isinstance(error, CommandError):
        return ErrorValue(str(error), error.code)
    # A library that was interrupted while it loaded may raise anything.
    if was_interrupted():
        return ErrorValue("", ExitCode.INTERRUPTED)
    # Whoever closed the pipe knows why; a message would only disturb the next output.
    if isinstance(error, BrokenPipeError):
        return ErrorValue("", ExitCode.BROKEN_PIPE)
    from daemon.batch.errors import DaemonError, KeysUnusable, PlaceUnusable, Refused

    if isinstance(error, DaemonError):
        # A daemon that refuses works: the request was wrong. Keys and places are named or written
        # by people.
        typed = isinstance(error, Refused | KeysUnusable | PlaceUnusable)
        return ErrorValue(str(error), ExitCode.BAD_INPUT if typed else ExitCode.INFRASTRUCTURE)
    # A full disk or a read-only folder is no bug of ours, and a traceback does not help.
    if isinstance(error, OSError):
        where = f": {error.filename}" if error.filename else ""
        code = ExitCode.BAD_INPUT if error.errno in _TYPED else ExitCode.INFRASTRUCTURE
        return ErrorValue(f"{error.strerror or error}{where}", code)
    say("".join(traceback.format_exception(error)).rstrip())
    message = f"a bug in scenario, please report it: {type(error).__name__}: {error}"
    return ErrorValue(message, ExitCode.BUG)
