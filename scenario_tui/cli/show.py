"""The command that shows one run: what each oracle says of it, or its log."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.batch.errors import TraceUnavailable, Unreachable
from daemon.model.run_state import RunState
from grammars.text.diagnostics import did_you_mean
from grammars.text.words import count_noun
from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer
from scenario_tui.cli.output import print_commands, print_line, stdout_console
from scenario_tui.source import DaemonTarget, bring_traces, find_run, open_source, why_no_trace
from scenario_tui.text.formatting import SHOWN_LINES, last_lines, printed_lines, time_text

if TYPE_CHECKING:
    from daemon.batch.paths import StatePaths
    from daemon.judging.assessment import Expectations
    from daemon.model.live_judgement import LogLine
    from daemon.model.status import RunDetail
    from daemon.model.verbs import CampaignSource
    from scenario_tui.cli.values import RunLog, RunSummary


def show(
    target: DaemonTarget,
    run: Annotated[
        str,
        typer.Argument(
            metavar="RUN",
            help="Id of a run, or a campaign's name, a dot and the run's number; or a trace.",
            autocompletion=completion.offers(completion.runs, completion.files(".mcap")),
        ),
    ],
    log: Annotated[
        bool,
        typer.Option(
            "--log",
            help="Tell what happened instead: attempts, mission, contacts, what the SUT said.",
        ),
    ] = False,
    everything: Annotated[
        bool, typer.Option("--all", help="With the log all lines of all outputs, not the last.")
    ] = False,
    output: Annotated[
        str,
        typer.Option(
            "--output",
            "-o",
            metavar="NAME",
            help="Of the log all that the system under test wrote to this output, stack.txt say.",
        ),
    ] = "",
) -> Answer[RunSummary] | Answer[RunLog]:
    """Show one run: what each oracle says and why, or what happened in it.

    It is read from the state directory of this machine unless a daemon is named. No daemon is
    needed, except to say how far a run is.
    """
    from daemon.analysis.recorded import read_marks
    from scenario_tui.cli.values import RunSummary

    wants_log = log or everything or bool(output)
    with open_source(run, target, judge=not wants_log) as source:
        detail = find_run(source, run)
        standing = "" if detail.row.trace else why_no_trace(detail.row, source, target)
        if wants_log:
            run_log = _read_log(source, detail, standing, target)
            if output and output not in run_log.printed:
                names = run_log.printed
                hint = (
                    did_you_mean(output, names)
                    if names
                    else "its system under test printed nothing"
                )
                message = f'no output "{output}" in this run: {hint}'
                raise typer.BadParameter(message, param_hint="--output")
            text = partial(_print_log, run_log, everything, target)
            if output:
                text = partial(_print_output, run_log.printed[output])
            return Answer("logs", run_log, text)
        search = source.search_row(detail.row.campaign)
        expectations = read_marks(source, detail.row)
    marks = expectations.mark_verdicts(detail.row) if expectations is not None else {}
    summary = RunSummary(detail, search.task if search else None, standing, marks=marks)
    if detail.row.state == RunState.RUNNING:
        summary = _with_progress(summary, target)
    return Answer("run", summary, partial(_print_run, summary, expectations, target))


def _with_progress(summary: RunSummary, target: DaemonTarget) -> RunSummary:
    """Return a running run with how far it is, which only a daemon that is there can say."""
    from scenario_tui.library.watching import latest_snapshot

    row = summary.run.row
    with suppress(Unreachable), target.open() as daemon:
        summary = replace(summary, live=latest_snapshot(daemon, row.id))
        workers = daemon.workers() if summary.live is None else ()
        prepares = [one.preparing for one in workers if one.id == row.worker]
        summary = replace(summary, standing=next(filter(None, prepares), summary.standing))
    return summary


def _print_run(
    summary: RunSummary, expectations: Expectations | None, target: DaemonTarget
) -> None:
    """Print what it was and what each oracle says, then what to type next."""
    from scenario_tui.text.run_text import run_text
    from scenario_tui.text.search_text import proposal_text

    row = summary.run.row
    print_line(run_text(summary.run, summary.live, expectations))
    is_starting = row.state == RunState.RUNNING and summary.live is None
    if is_starting or (row.state == RunState.QUEUED and not row.reason):
        print_line(f"{summary.standing}\n")
    if row.proposal is not None and summary.task is not None:
        about = proposal_text(summary.task, row.proposal, stdout_console().width)
        print_line(about)
    print_commands(*_next_commands(summary, target))


def _next_commands(summary: RunSummary, target: DaemonTarget) -> Iterator[tuple[str, str]]:
    row = summary.run.row
    if row.trace:
        begin = ("--from", row.oracle) if row.outcome == "fail" else ()
        yield target.command("replay", row.id, *begin), "watch it"
    yield target.command("show", row.id, "--log"), "what happened, in order"
    if not row.repeatable and row.trace:
        yield target.command("verify", row.id), "how far its outcomes spread"
    if summary.task is not None:
        yield target.command("search", row.campaign), "the search it belongs to"
    elif row.outcome == "fail":
        yield target.command("blame", row.id), "what makes it fail"
    if row.state in (RunState.LOST, RunState.CANCELLED):
        yield target.command("retry", row.campaign), "queue what is lost or cancelled again"


def _read_log(
    source: CampaignSource, detail: RunDetail, standing: str, target: DaemonTarget
) -> RunLog:
    """Return what a run left; a daemon elsewhere does not tell of attempts."""
    from daemon.batch.ledger import LedgerReader
    from scenario_tui.cli.values import RunLog, RunStep

    row = detail.row
    log = RunLog(row.id, row.attempt, row.reason, standing=standing)
    # Attempts and what they print are of the state directory: no verb of the bus has them.
    if isinstance(source, LedgerReader):
        steps = tuple(RunStep(*step) for step in source.steps(row.id))
        log = replace(log, steps=steps, output=_read_outputs(target.paths, row.id))
    if not row.trace:
        return log
    from daemon.judging.run_log import ended_run_log
    from daemon.trace import read_outputs, read_trace

    (trace,) = bring_traces((row,), source, target)
    if isinstance(trace, TraceUnavailable):
        raise trace
    return replace(log, recorded=ended_run_log(read_trace(trace)), printed=read_outputs(trace))


def _read_outputs(paths: StatePaths, run: str) -> tuple[str, ...]:
    """Return what attempts on this machine printed that are running or not yet handed over.

    Of each the first and the last part, about a MiB at most.
    """
    from daemon.batch.run_process import OUTPUT, read_output
    from grammars.text.files import matching_paths

    files = sorted(matching_paths(paths.spool, f"*/{run}/attempt-*/{OUTPUT}"))
    texts = (read_output(file.parent).decode("utf-8", "replace").strip() for file in files)
    return tuple(filter(None, texts))


def _print_log(log: RunLog, everything: bool, target: DaemonTarget) -> None:
    """Print a log in order, of printed outputs the last lines or everything."""
    _print_steps(log)
    # The reason is the note of an attempt, as long as that attempt is remembered.
    has_reason = any(step.note.strip() == log.reason.strip() for step in log.steps)
    for text in filter(None, (*log.output, "" if has_reason else log.reason)):
        print_line(f"\n{text.strip()}")
    if log.recorded:
        if log.steps or log.attempts or log.standing:
            print_line()
        _print_recorded(log.recorded)
    for name, text in log.printed.items():
        lines, hidden = last_lines(text, None if everything else SHOWN_LINES)
        print_line(f"\n{name}", style="dim")
        if hidden:
            more = f"{count_noun(hidden, 'line')} before these"
            how = target.command("show", log.run, "--output", name)
            print_line(f"({more}: {how})", style="dim")
        for line in lines or ["(nothing)"]:
            print_line(line)


def _print_steps(log: RunLog) -> None:
    for step in log.steps:
        when = datetime.fromtimestamp(step.at).astimezone().strftime("%Y-%m-%d %H:%M:%S")
        note = f"  {step.note.strip()}" if step.note else ""
        print_line(f"{when}  {step.state}{note}")
    if log.steps:
        return
    if log.attempts:
        attempts = count_noun(log.attempts, "attempt")
        print_line(f"{attempts}; when is not remembered any more")
    elif log.standing:
        print_line(log.standing)


def _print_recorded(recorded: tuple[LogLine, ...]) -> None:
    from rich.text import Text

    print_line("in simulated time", style="dim")
    styles = {"warn": "yellow", "error": "bold red", "fatal": "bold red"}
    width = max(len(line.source) for line in recorded)
    for line in recorded:
        text = Text(f"{time_text(line.time):>10}  {line.source:<{width}}  ")
        # What nodes log is anybody's text, as what they print is.
        words = "\n".join(printed_lines(line.text))
        print_line(text.append(words, style=styles.get(line.level, "")))


def _print_output(text: str) -> None:
    for line in printed_lines(text):
        print_line(line)
