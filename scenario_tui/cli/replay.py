"""The command that plays a recorded run, or two of them side by side."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated

import typer

from scenario_tui.cli import completion
from scenario_tui.cli.answer import CommandError, ExitCode, wrong_usage
from scenario_tui.cli.options import RunOrTrace
from scenario_tui.cli.output import print_line, stdout_console
from scenario_tui.source import DaemonTarget, one_trace, verdict_marks

if TYPE_CHECKING:
    from daemon.model.assessments import Mark
    from scenario_tui.dashboard.playback import Playback


def replay(
    run: RunOrTrace,
    other: Annotated[
        str,
        typer.Argument(
            metavar="[OTHER]",
            help="Another run, to see both side by side.",
            autocompletion=completion.offers(completion.runs, completion.files(".mcap")),
        ),
    ] = "",
    start: Annotated[
        str,
        typer.Option(
            "--from",
            metavar="SECONDS|ORACLE",
            help="Begin at this moment, or when this oracle was decided.",
            autocompletion=completion.offers(completion.oracles),
        ),
    ] = "",
    speed: Annotated[
        float, typer.Option(min=0.1, max=1000.0, help="Simulated seconds per second.")
    ] = 1.0,
    frame: Annotated[
        str,
        typer.Option(
            metavar="SECONDS|ORACLE",
            help="Only print this moment as text: a time in seconds, such as 124.2, or an oracle. "
            "Needs no terminal.",
            autocompletion=completion.offers(completion.oracles),
        ),
    ] = "",
    *,
    target: DaemonTarget,
) -> ExitCode:
    """Watch a recorded run from above with its verdicts, or two runs side by side."""
    from scenario_tui.dashboard.playback import open_playback
    from scenario_tui.terminal.capabilities import why_undrawable

    if frame and other:
        raise typer.BadParameter("works with one run only", param_hint="--frame")
    trace = one_trace(run, target)
    if frame:
        _print_frame(open_playback(trace), frame, verdict_marks(run, target))
        return ExitCode.EXPECTED
    reason = why_undrawable()
    # Drawn on standard error like the dashboard, with keys from standard input.
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        scripts = target.command("replay", run, "--frame", "10")
        reason = f"a replay needs a terminal; scripts can use `{scripts}`"
    if reason and not other:
        raise CommandError(reason)
    first, marks = open_playback(trace), verdict_marks(run, target)
    begin = _moment(first, start, "--from") if start else None
    second = open_playback(one_trace(other, target)) if other else None
    both = (marks, verdict_marks(other, target) if other else marks)
    if second is not None and reason:
        from scenario_tui.text.comparison_text import comparison_text

        pairs = (first.verdicts, second.verdicts, first.trace.spec, second.trace.spec)
        print_line(comparison_text(*pairs, both))
        return ExitCode.EXPECTED
    from scenario_tui.dashboard.screens.compare import CompareScreen
    from scenario_tui.dashboard.screens.replay import ReplayScreen
    from scenario_tui.dashboard.screens.standalone import run_alone

    if second is None:
        failed = run_alone(ReplayScreen(first, begin, speed, marks=marks))
    else:
        failed = run_alone(CompareScreen(first, second, marks=both, begin=begin, speed=speed))
    return ExitCode.BUG if failed else ExitCode.EXPECTED


def _moment(playback: Playback, text: str, option: str) -> float:
    with wrong_usage(option):
        return playback.time_of(text)


def _print_frame(playback: Playback, moment: str, marks: Mapping[str, Mark]) -> None:
    from scenario_tui.dashboard.playback import render_frame
    from scenario_tui.text.ascii_signs import text_in_ascii

    time = _moment(playback, moment, "--frame")
    size = shutil.get_terminal_size((80, 24))
    # The output may go anywhere, so ASCII is used on request only.
    plain = os.environ.get("SCENARIO_GLYPHS") == "ascii"
    verdict = next((one for one in playback.verdicts if one.oracle == moment), None)
    room = (size.columns, size.lines - 1)
    lines = render_frame(playback, time, *room, verdict=verdict, marks=marks)
    for line in lines:
        text = text_in_ascii(line) if plain else line
        stdout_console().print(text, no_wrap=True, soft_wrap=True)
