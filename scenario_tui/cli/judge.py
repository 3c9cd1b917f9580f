"""The command that judges recorded runs again."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scenario_tui.cli import completion
from scenario_tui.cli.completion import oracle_files
from scenario_tui.cli.exit_codes import exit_code
from scenario_tui.cli.options import AsJson, Connect, Processes, State
from scenario_tui.cli.output import Output, OutputPart, say, stdout_console, track_progress

if TYPE_CHECKING:
    from daemon.analysis.rejudge import OracleChange, RejudgedTrace, VerdictOrigin
    from daemon.model.verdicts import Outcome, Verdict


class JudgedChange(OutputPart):
    """Verdict of an oracle before and now."""

    oracle: str
    change: str
    before: Outcome | None
    now: Outcome | None
    margin_before: float | None
    margin_now: float | None

    @classmethod
    def of(cls, change: OracleChange) -> JudgedChange:
        """Return a change without the evidence of its verdicts."""
        before, now = change.before, change.now
        return cls(
            change.oracle,
            change.kind,
            before.outcome if before else None,
            now.outcome if now else None,
            before.margin if before else None,
            now.margin if now else None,
        )


class JudgedTrace(OutputPart):
    """A trace judged again: the fields of a :class:`RejudgedTrace`, and what is different."""

    trace: str
    run: str
    digest: str
    outcome: Outcome
    verdicts: tuple[Verdict, ...]
    outcome_before: Outcome | None
    before: tuple[Verdict, ...]
    origin: VerdictOrigin
    problem: str
    changes: list[JudgedChange]

    @classmethod
    def of(cls, one: RejudgedTrace) -> JudgedTrace:
        """Return a trace as it is written."""
        values = {field.name: getattr(one, field.name) for field in fields(one)}
        return cls(**values, changes=[JudgedChange.of(change) for change in one.changes])


class JudgeOutput(Output, schema="judge"):
    """Traces judged by a layer of ``oracles``, by their own without one."""

    oracles: str
    traces: list[JudgedTrace]


def judge(
    traces: Annotated[
        list[str],
        typer.Argument(
            metavar="TRACES",
            help="Traces (.mcap), folders of them, or ids of campaigns or runs.",
            autocompletion=completion.campaigns_runs_or_traces,
        ),
    ],
    oracles: Annotated[
        Path | None,
        typer.Option(
            "--oracles",
            "-o",
            metavar="FILE",
            help="Oracle layer to judge by, such as navigation.oracles.yaml. "
            "Default: the oracles inside of each trace.",
            autocompletion=completion.files(oracle_files),
        ),
    ] = None,
    processes: Processes = None,
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Judge recorded runs again and say which verdicts differ; traces stay as they are."""
    from daemon.analysis.rejudge import rejudge
    from daemon.model.spec import OracleText
    from grammars.oracle import load_oracles
    from scenario_tui.cli.named_traces import all_traces, refuse_other_files
    from scenario_tui.cli.target import DaemonTarget

    layer = None
    if oracles is not None:
        layer = tuple(OracleText(o.name, o.text) for o in load_oracles(oracles).values())
    target = DaemonTarget(connect, state)
    refuse_other_files(traces, "TRACES")
    paths = all_traces(traces, target, "TRACES")
    # A generator: traces are judged by several processes while the bar counts what comes back.
    judged = rejudge(paths, layer, places=target.paths, processes=processes)
    results = tuple(track_progress(judged, len(paths), "judging"))
    if as_json:
        JudgeOutput(str(oracles or ""), [JudgedTrace.of(one) for one in results]).emit()
    else:
        _print_rejudged(results)
    raise typer.Exit(exit_code(str(one.outcome) for one in results))


def _print_rejudged(results: tuple[RejudgedTrace, ...]) -> None:
    from scenario_tui.text.comparison_text import (
        LISTED,
        change_lines,
        rejudge_summary,
        rejudge_table,
    )
    from scenario_tui.text.formatting import TERMINAL_STYLES

    console = stdout_console()
    judged = [one for one in results if not one.problem]
    if judged:
        console.print(rejudge_table(judged, TERMINAL_STYLES))
        console.print()
        lines = change_lines(judged, TERMINAL_STYLES)
        for line in lines[:LISTED]:
            console.print(line, soft_wrap=True)
        if len(lines) > LISTED:
            more = len(lines) - LISTED
            console.print(f"and {more} more verdicts that changed (--json lists all)")
        if lines:
            console.print()
    for one in results:
        if one.problem:
            say(f"{one.trace}: error: {one.problem}")
    console.print(rejudge_summary(judged, len(results) - len(judged)), soft_wrap=True)
