"""The command that shows one run: its verdicts, or its log."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.batch.errors import TraceUnavailable, Unreachable
from daemon.model.verdicts import RunState
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
            help="Id of a run, or name of a campaign, a dot and the run's number; or a trace.",
            autocompletion=completion.offers(completion.runs, completion.files(".mcap")),
        ),
    ],
    log: Annotated[
        bool, "Show the log instead: attempts, mission, contacts, messages of the SUT."
    ] = False,
    everything: Annotated[bool, "--all", "Show the log with all lines of all outputs."] = False,
    output: Annotated[
        str,
        typer.Option(
            "-o",
            metavar="NAME",
            help="Show only this output of the system under test, such as stack.txt.",
        ),
    ] = "",
) -> Answer[RunSummary] | Answer[RunLog]:
    """Show one run: the verdict of each oracle and its reason, or the log.

    It comes from the state directory of this machine, unless a daemon is named. Only the progress
    of a run needs a daemon.
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
                message = f'this run has no output "{output}": {hint}'
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
    """Return a running run with its progress, if a daemon answers."""
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
    """Print the run and its verdicts, then suggested commands."""
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
        yield target.command("verify", row.id), "how much its outcomes vary"
    if summary.task is not None:
        yield target.command("search", row.campaign), "the search it belongs to"
    elif row.outcome == "fail":
        yield target.command("blame", row.id), "why it fails"
    if row.state in (RunState.LOST, RunState.CANCELLED):
        yield target.command("retry", row.campaign), "queue lost or cancelled runs again"


def _read_log(
    source: CampaignSource, detail: RunDetail, standing: str, target: DaemonTarget
) -> RunLog:
    """Return the log of a run; a daemon elsewhere does not tell its attempts."""
    from daemon.batch.ledger import LedgerReader
    from scenario_tui.cli.values import RunLog, RunStep

    row = detail.row
    log = RunLog(row.id, row.attempt, row.reason, standing=standing)
    # Only the state directory has attempts and their output, no verb of the bus does.
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
    """Return the output of attempts on this machine that run or are not yet handed over.

    It has the first and the last part of each output, about a MiB at most.
    """
    from daemon.batch.run_process import OUTPUT, read_output
    from grammars.text.files import matching_paths

    files = sorted(matching_paths(paths.spool, f"*/{run}/attempt-*/{OUTPUT}"))
    texts = (read_output(file.parent).decode("utf-8", "replace").strip() for file in files)
    return tuple(filter(None, texts))


def _print_log(log: RunLog, everything: bool, target: DaemonTarget) -> None:
    """Print a log in order, with the last lines of each output, or all lines."""
    _print_steps(log)
    # The note of an attempt has the reason already, while that attempt is stored.
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
        print_line(f"{attempts}; their times are not stored any more")
    elif log.standing:
        print_line(log.standing)


def _print_recorded(recorded: tuple[LogLine, ...]) -> None:
    from rich.text import Text

    print_line("in simulated time", style="dim")
    styles = {"warn": "yellow", "error": "bold red", "fatal": "bold red"}
    width = max(len(line.source) for line in recorded)
    for line in recorded:
        text = Text(f"{time_text(line.time):>10}  {line.source:<{width}}  ")
        # Log messages of nodes may hold any text, as printed output may.
        words = "\n".join(printed_lines(line.text))
        print_line(text.append(words, style=styles.get(line.level, "")))


def _print_output(text: str) -> None:
    for line in printed_lines(text):
        print_line(line)
