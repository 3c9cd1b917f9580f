"""Output streams: results go to standard output, messages and progress to standard error."""

from __future__ import annotations

import codecs
import io
import logging
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Literal, TypeVar

from grammars.text.diagnostics import Finding
from grammars.text.terminal_text import printable, printable_streams
from scenario_tui.text.formatting import plain_table as plain_table

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, ProgressColumn
    from rich.text import Text

T = TypeVar("T")


def _replace_signs(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    from scenario_tui.text.ascii_signs import spell_in_ascii

    return spell_in_ascii(error.object[error.start : error.end]), error.end


class _LibraryMessages(logging.Handler):
    """Prints the messages that the library logs while it works."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write a message."""
        say(record.getMessage())


@contextmanager
def library_messages() -> Iterator[None]:
    """Print the messages of the library to standard error meanwhile."""
    log, handler = logging.getLogger("scenario_tui"), _LibraryMessages()
    level = log.level
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    try:
        yield
    finally:
        log.removeHandler(handler)
        log.setLevel(level)


def settle_streams() -> None:
    """Make standard streams usable that are closed or cannot encode our output.

    A closed stream becomes the null device, so that no file of ours takes its descriptor. Signs
    that the terminal's encoding lacks are replaced.
    """
    codecs.register_error("scenario.plainly", _replace_signs)
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115, PTH123
        elif name != "stdin" and isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="scenario.plainly")


def stdout_console() -> Console:
    """Return the console of results."""
    from scenario_tui.terminal.printable_console import open_console

    return open_console(stderr=False)


def stderr_console() -> Console:
    """Return the console of messages and progress."""
    from scenario_tui.terminal.printable_console import open_console

    return open_console(stderr=True)


@contextmanager
def open_progress(*columns: str | ProgressColumn, threads: bool = True) -> Iterator[Progress]:
    """Show progress on a terminal, and remove it afterwards.

    Without ``threads`` it is drawn at each step only, not ten times a second.
    """
    from rich.progress import BarColumn, Progress, TaskProgressColumn

    console = stderr_console()
    # Without the remaining time of rich: it is a guess, in another notation than ours.
    progress = Progress(
        *(columns or ("{task.description}", BarColumn(), TaskProgressColumn())),
        console=console,
        auto_refresh=threads,
        transient=True,
        disable=not console.is_terminal,
    )
    # Other output passes through rich meanwhile, which would interpret its colours.
    with progress, printable_streams():
        yield progress


@contextmanager
def show_progress(
    doing: str, total: int, unit: Literal["traces", "bytes"]
) -> Iterator[Callable[[int], None]]:
    """Show how much of ``total`` is done; yields a function that counts traces or bytes."""
    if not total:
        yield lambda _: None
        return
    from rich.progress import BarColumn, DownloadColumn, MofNCompleteColumn, TransferSpeedColumn

    amounts: tuple[ProgressColumn, ...] = (MofNCompleteColumn(),)
    if unit == "bytes":
        amounts = (DownloadColumn(), TransferSpeedColumn())
    # Traces are judged by forked processes; threads do not survive a fork.
    with open_progress(doing, BarColumn(), *amounts, threads=unit == "bytes") as progress:
        task = progress.add_task("", total=total)
        yield lambda count: progress.update(task, advance=count, refresh=unit == "traces")


def track_progress(results: Iterable[T], total: int, description: str) -> Iterator[T]:
    """Yield all ``results``, and show the progress on a terminal."""
    # Processes are forked meanwhile; threads do not survive a fork.
    with open_progress(threads=False) as progress:
        yield from progress.track(results, total=total, description=description)


def print_line(text: str | Text = "", style: str | None = None) -> None:
    """Print a line of results; the terminal wraps it, so people can copy the whole line."""
    stdout_console().print(text, style=style, soft_wrap=True)


def print_commands(*commands: tuple[str, str]) -> None:
    """Print suggested commands: ``(command, purpose)`` pairs, the purpose if it fits."""
    from rich.text import Text

    console = stdout_console()
    width = max(len(command) for command, _ in commands)
    roomy = all(width + len(purpose) + 4 <= console.width for _, purpose in commands)
    for command, purpose in commands:
        line = Text.assemble("  ", (command, "bold cyan"))
        if roomy:
            line.append(f"{'':{width - len(command)}}  {purpose}", style="dim")
        console.print(line, soft_wrap=True)


def say(message: str) -> None:
    """Write a message for people to standard error; a closed pipe is no error."""
    with suppress(BrokenPipeError):
        sys.stderr.write(printable(message) + "\n")
        sys.stderr.flush()


def report_findings(findings: Iterable[Finding]) -> None:
    """Print every finding to standard error; a closed pipe is no error."""
    from scenario_tui.text.diagnostics import render_diagnostic

    console = stderr_console()
    # rich exits when a pipe is broken, but the exit code is the command's.
    with suppress(SystemExit):
        for finding in findings:
            console.print(render_diagnostic(finding), soft_wrap=True)
