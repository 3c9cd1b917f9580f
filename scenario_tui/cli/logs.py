"""The log of a run: the events in it, and the output of its system under test."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from scenario_tui.cli.output import Output, stdout_console

if TYPE_CHECKING:
    from collections.abc import Mapping

    from daemon.batch.paths import StatePaths
    from daemon.model.live_judgement import LogLine
    from scenario_tui.source import DaemonTarget


@dataclass(frozen=True, slots=True)
class RunStep:
    """A step in the life of a run: the state it came to, when, and why if there is a reason."""

    at: float
    state: str
    note: str


class LogsOutput(Output, schema="logs"):
    """Log of a run: the ``steps`` of its attempts, their ``output``, events that it recorded.

    ``printed`` is what an external system under test wrote while it ran, by name. Of a trace
    alone only what it recorded and printed is known. ``standing`` says why there is no trace of it
    (yet), empty when there is one.
    """

    run: str
    attempts: int
    reason: str
    steps: tuple[RunStep, ...]
    output: tuple[str, ...]
    recorded: tuple[LogLine, ...]
    printed: dict[str, str]
    standing: str = ""

    def print(self) -> None:
        """Print it in the order it happened, of what was printed the last lines."""
        self.print_for(self.run, everything=False)

    def print_for(self, typed: str, *, everything: bool) -> None:
        """Print it to somebody who ``typed`` that name, with ``everything`` that was printed."""
        if self.run:
            self._print_steps()
            # The reason is the note of an attempt, as long as that attempt is remembered.
            has_reason = any(step.note.strip() == self.reason.strip() for step in self.steps)
            for text in filter(None, (*self.output, "" if has_reason else self.reason)):
                stdout_console().print(f"\n{text.strip()}", markup=False, soft_wrap=True)
        if self.recorded or not self.run:
            self._print_recorded()
        self._print_printed(typed, everything=everything)

    def _print_steps(self) -> None:
        from datetime import datetime

        from grammars.text.words import count_noun

        console = stdout_console()
        for step in self.steps:
            when = datetime.fromtimestamp(step.at).astimezone().strftime("%Y-%m-%d %H:%M:%S")
            note = f"  {step.note.strip()}" if step.note else ""
            console.print(f"{when}  {step.state}{note}", markup=False, soft_wrap=True)
        if not self.steps and not self.attempts:
            words = self.standing or "no attempt yet"
            console.print(words, markup=False, soft_wrap=True)
        elif not self.steps:
            attempts = count_noun(self.attempts, "attempt")
            console.print(f"{attempts}; when is not remembered any more")

    def _print_recorded(self) -> None:
        from rich.text import Text

        from scenario_tui.text.formatting import printed_lines, time_text

        console = stdout_console()
        console.print("\nin simulated time", style="dim")
        styles = {"warn": "yellow", "error": "bold red", "fatal": "bold red"}
        width = max(len(line.source) for line in self.recorded)
        for line in self.recorded:
            text = Text(f"{time_text(line.time):>10}  {line.source:<{width}}  ")
            # What nodes log is anybody's text, as what they print is.
            words = "\n".join(printed_lines(line.text))
            console.print(text.append(words, style=styles.get(line.level, "")), soft_wrap=True)

    def _print_printed(self, typed: str, *, everything: bool) -> None:
        from shlex import quote

        from grammars.text.words import count_noun
        from scenario_tui.text.formatting import SHOWN_LINES, last_lines

        console = stdout_console()
        for name, text in self.printed.items():
            lines, hidden = last_lines(text, None if everything else SHOWN_LINES)
            console.print(f"\n{name}", markup=False, style="dim", soft_wrap=True)
            if hidden:
                more = f"{count_noun(hidden, 'line')} before these"
                how = f"scenario show {quote(typed)} --output {quote(name)}"
                console.print(f"({more}: {how})", markup=False, style="dim", soft_wrap=True)
            for line in lines or ["(nothing)"]:
                console.print(line, markup=False, soft_wrap=True)


def show_log(
    run: str, output: str, target: DaemonTarget, *, everything: bool, as_json: bool
) -> None:
    """Print what happened in a run: its attempts, its mission, contacts, what the SUT said.

    An external system's outputs are printed with their last lines, or with ``everything``; with
    the name of an ``output`` that one alone. No daemon is needed unless one is named.
    """
    if run.endswith(".mcap"):
        log = LogsOutput("", 0, "", (), (), *_recorded(Path(run)))
    else:
        log = _collect_logs(run, target)
    if output:
        _check_output(log.printed, output)
    if as_json:
        log.emit()
    elif output:
        _print_output(log.printed[output])
    else:
        log.print_for(run, everything=everything)


def _check_output(printed: Mapping[str, str], name: str) -> None:
    """Raise wrong usage for an output that the run has not."""
    from grammars.text.diagnostics import did_you_mean

    if name in printed:
        return
    hint = did_you_mean(name, printed) if printed else "its system under test printed nothing"
    raise typer.BadParameter(f'no output "{name}" in this run: {hint}', param_hint="--output")


def _print_output(text: str) -> None:
    from scenario_tui.text.formatting import printed_lines

    for line in printed_lines(text):
        stdout_console().print(line, markup=False, soft_wrap=True)


def _recorded(trace: Path) -> tuple[tuple[LogLine, ...], dict[str, str]]:
    """Return what a trace recorded in words, and what it keeps that was printed."""
    from daemon.judging.run_log import ended_run_log
    from daemon.trace import read_outputs, read_trace

    return ended_run_log(read_trace(trace)), read_outputs(trace)


def _collect_logs(run: str, target: DaemonTarget) -> LogsOutput:
    """Return what a run left; a daemon elsewhere does not tell of attempts."""
    from daemon.batch.ledger import LedgerReader
    from scenario_tui.source import find_campaign, find_run, one_trace
    from scenario_tui.text.run_state import without_trace_text

    steps: tuple[RunStep, ...] = ()
    output: tuple[str, ...] = ()
    with target.open() if target.named else LedgerReader.open(target.paths) as source:
        row = find_run(source, run).row
        campaign = None if row.trace else find_campaign(source, row.campaign)
        # Attempts and what they print are of the state directory: no verb of the bus has them.
        if isinstance(source, LedgerReader):
            steps = tuple(RunStep(*step) for step in source.steps(row.id))
            output = _read_outputs(target.paths, row.id)
    recorded, printed = _recorded(one_trace(row.id, target)) if row.trace else ((), {})
    standing = "" if row.trace else without_trace_text(row, campaign)
    return LogsOutput(row.id, row.attempt, row.reason, steps, output, recorded, printed, standing)


def _read_outputs(paths: StatePaths, run: str) -> tuple[str, ...]:
    """Return what attempts on this machine printed that are running or not yet handed over.

    Of each the first and the last part, about a MiB at most.
    """
    from daemon.batch.run_process import OUTPUT, read_output
    from grammars.text.files import matching_paths

    files = sorted(matching_paths(paths.spool, f"*/{run}/attempt-*/{OUTPUT}"))
    texts = (read_output(file.parent).decode("utf-8", "replace").strip() for file in files)
    return tuple(filter(None, texts))
