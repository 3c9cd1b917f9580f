"""The command that judges recorded runs again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from scenario_tui.cli import completion
from scenario_tui.cli.completion import oracle_files
from scenario_tui.cli.exit_codes import exit_code
from scenario_tui.cli.options import AsJson, Connect, State

if TYPE_CHECKING:
    from collections.abc import Sequence

    from daemon.analysis.rejudge import RejudgedTrace


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
    processes: Annotated[
        int | None,
        typer.Option("--processes", "-j", min=1, max=1024, help="Default: one per core."),
    ] = None,
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Judge recorded runs again and say which verdicts differ; traces stay as they are."""
    from daemon.analysis.rejudge import rejudge
    from daemon.model.spec import OracleText
    from grammars.oracle import load_oracles
    from scenario_tui.cli.output import emit, track_progress
    from scenario_tui.cli.target import DaemonTarget, all_traces

    written = None
    if oracles is not None:
        written = tuple(OracleText(o.name, o.text) for o in load_oracles(oracles).values())
    target = DaemonTarget(connect, state)
    paths = all_traces(traces, target, "TRACES")
    judged = rejudge(paths, written, places=target.places, processes=processes)
    found = tuple(track_progress(judged, len(paths), "judging"))
    if as_json:
        emit("judge", oracles=str(oracles or ""), traces=[_plain_rejudged(one) for one in found])
    else:
        _print_rejudged(found)
    raise typer.Exit(exit_code(str(one.outcome) for one in found))


def _plain_rejudged(one: RejudgedTrace) -> dict[str, Any]:
    from grammars.text.codec import to_plain

    changes = [
        {
            "oracle": change.oracle,
            "change": change.kind,
            "before": None if change.before is None else change.before.outcome,
            "now": None if change.now is None else change.now.outcome,
            "margin_before": None if change.before is None else change.before.margin,
            "margin_now": None if change.now is None else change.now.margin,
        }
        for change in one.changes
    ]
    plain: dict[str, Any] = to_plain(one)
    return plain | {"changes": changes}


def _print_rejudged(found: Sequence[RejudgedTrace]) -> None:
    from scenario_tui.cli.output import say, stdout_console
    from scenario_tui.text.formatting import TERMINAL_STYLES
    from scenario_tui.text.rejudge_text import LISTED, change_lines, rejudge_summary, rejudge_table

    console = stdout_console()
    judged = [one for one in found if not one.problem]
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
    for one in found:
        if one.problem:
            say(f"{one.trace}: error: {one.problem}")
    console.print(rejudge_summary(judged, len(found) - len(judged)), soft_wrap=True)
