"""The command that judges recorded runs again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from scenario_tui.cli import _completion
from scenario_tui.cli._exits import exit_code
from scenario_tui.cli._files import oracle_files
from scenario_tui.cli._options import AsJson, Connect, State

if TYPE_CHECKING:
    from collections.abc import Sequence

    from daemon.rejudge import Rejudged


def judge(
    traces: Annotated[
        list[str],
        typer.Argument(
            metavar="TRACES",
            help="Traces (.mcap), folders of them, or ids of campaigns or runs.",
            autocompletion=_completion.recorded,
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
            autocompletion=_completion.files(oracle_files),
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
    from daemon.rejudge import rejudge
    from daemon.spec import OracleText
    from grammars.oracle import load_oracles
    from scenario_tui.cli._chosen import all_traces
    from scenario_tui.cli._output import emit, watched
    from scenario_tui.cli._session import Target

    written = None
    if oracles is not None:
        written = tuple(OracleText(o.name, o.text) for o in load_oracles(oracles).values())
    target = Target(connect, state)
    paths = all_traces(traces, target, "TRACES")
    judged = rejudge(paths, written, places=target.places, processes=processes)
    found = tuple(watched(judged, len(paths), "judging"))
    if as_json:
        emit("judge", oracles=str(oracles or ""), traces=[_plain(one) for one in found])
    else:
        _print(found)
    raise typer.Exit(exit_code(str(one.outcome) for one in found))


def _plain(one: Rejudged) -> dict[str, Any]:
    from grammars.codec import to_plain

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


def _print(found: Sequence[Rejudged]) -> None:
    from scenario_tui.cli._output import out, say
    from scenario_tui.rejudged import LISTED, change_lines, closing, table
    from scenario_tui.wording import STYLES

    console = out()
    judged = [one for one in found if not one.problem]
    if judged:
        console.print(table(judged, STYLES))
        console.print()
        lines = change_lines(judged, STYLES)
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
    console.print(closing(judged, len(found) - len(judged)), soft_wrap=True)
