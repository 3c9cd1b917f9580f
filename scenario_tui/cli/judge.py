"""The command that judges recorded runs again."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer, exit_code
from scenario_tui.cli.options import Processes
from scenario_tui.cli.output import stdout_console, track_progress
from scenario_tui.source import DaemonTarget, all_traces

if TYPE_CHECKING:
    from daemon.analysis.rejudge import RejudgedTrace, Rejudgement


def judge(
    traces: Annotated[
        list[str],
        typer.Argument(
            metavar="TRACES",
            help="Traces (.mcap), folders of them, or ids of campaigns or runs.",
            autocompletion=completion.offers(
                completion.campaigns, completion.runs, completion.files(".mcap")
            ),
        ),
    ],
    oracles: Annotated[
        Path | None,
        typer.Option(
            "-o",
            metavar="FILE",
            help="Oracle layer to judge by, such as navigation.oracles.yaml. "
            "Default: the oracles in each trace.",
            autocompletion=completion.offers(completion.files(".oracles.yaml")),
        ),
    ] = None,
    processes: Processes = None,
    *,
    target: DaemonTarget,
) -> Answer[Rejudgement]:
    """Judge recorded runs again and list the verdicts that differ.

    The traces do not change.
    """
    from daemon.analysis.rejudge import Rejudgement, rejudge
    from daemon.model.spec import OracleText
    from grammars.oracle import load_oracles

    layer = None
    if oracles is not None:
        layer = tuple(OracleText(o.name, o.text) for o in load_oracles(oracles).values())
    paths = all_traces(traces, target)
    # A generator: several processes judge traces while the bar counts the answers.
    judged = rejudge(paths, layer, places=target.paths, processes=processes)
    results = tuple(track_progress(judged, len(paths), "judging"))
    value = Rejudgement(str(oracles or ""), results)
    code = exit_code(str(one.outcome) for one in results)
    return Answer("judge", value, partial(_print, results), code)


def _print(results: tuple[RejudgedTrace, ...]) -> None:
    from scenario_tui.text.comparison_text import rejudge_parts

    for part in rejudge_parts(results):
        stdout_console().print(part)
