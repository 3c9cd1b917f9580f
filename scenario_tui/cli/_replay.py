"""The command that plays a recorded run in the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from scenario_tui.cli import _completion
from scenario_tui.cli._exits import ExitCode
from scenario_tui.cli._options import AsJson, Connect, RunOrTrace, State

if TYPE_CHECKING:
    from pathlib import Path

    from scenario_tui.playback import Playback


def replay(
    run: RunOrTrace,
    other: Annotated[
        str,
        typer.Argument(
            metavar="[OTHER]",
            help="Another run, to see both side by side.",
            autocompletion=_completion.runs_or_traces,
        ),
    ] = "",
    start: Annotated[
        str,
        typer.Option(
            "--from",
            metavar="SECONDS|ORACLE",
            help="Begin there: a moment, or when that oracle was decided.",
            autocompletion=_completion.oracles,
        ),
    ] = "",
    speed: Annotated[
        float,
        typer.Option("--speed", min=0.1, max=1000.0, help="Simulated seconds a second."),
    ] = 1.0,
    frame: Annotated[
        str,
        typer.Option(
            "--frame",
            metavar="SECONDS|ORACLE",
            help="Only print this moment as text; needs no terminal.",
            autocompletion=_completion.oracles,
        ),
    ] = "",
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:  # fmt: skip
    """Watch a recorded run from above, with what its oracles say, or two of them side by side."""
    import sys

    from scenario_tui.cli._chosen import one_trace
    from scenario_tui.cli._output import say
    from scenario_tui.cli._session import Target
    from scenario_tui.limits import undrawable
    from scenario_tui.playback import open_playback

    if as_json and not frame:
        raise typer.BadParameter("goes with --frame only", param_hint="--json")
    target = Target(connect, state)
    trace = one_trace(run, target, "RUN")
    if other:
        if frame:
            raise typer.BadParameter("goes with one run only", param_hint="--frame")
        _compare(trace, one_trace(other, target, "OTHER"), start, speed)
        return
    if not frame and not (sys.stdin.isatty() and sys.stderr.isatty()):
        say("scenario: a replay needs a terminal; scripts use `scenario replay RUN --frame 10`")
        raise typer.Exit(ExitCode.BAD_INPUT)
    if not frame and (why := undrawable()):
        say(f"scenario: {why}")
        raise typer.Exit(ExitCode.BAD_INPUT)
    playback = open_playback(trace)
    if frame:
        _print(playback, _moment(playback, frame, "--frame"), as_json=as_json)
        return
    from scenario_tui.screens.replay import ReplayScreen, run_replay

    begin = _moment(playback, start, "--from") if start else playback.start
    code = run_replay(ReplayScreen(playback, begin, speed))
    if code:
        raise typer.Exit(ExitCode.BUG)


def _compare(first: Path, second: Path, start: str, speed: float) -> None:
    """Show two runs side by side; without a terminal print how they differ."""
    import sys

    from scenario_tui.cli._output import out
    from scenario_tui.comparison_text import comparison_text
    from scenario_tui.limits import undrawable
    from scenario_tui.playback import open_playback

    both = open_playback(first), open_playback(second)
    begin = _moment(both[0], start, "--from") if start else both[0].start
    if undrawable() or not (sys.stdin.isatty() and sys.stderr.isatty()):
        verdicts, specs = zip(*((one.verdicts, one.trace.spec) for one in both), strict=True)
        out().print(comparison_text(*verdicts, *specs), soft_wrap=True)
        return
    from scenario_tui.screens.compare import CompareScreen
    from scenario_tui.screens.replay import run_replay

    code = run_replay(CompareScreen(*both, begin=begin, speed=speed))
    if code:
        raise typer.Exit(ExitCode.BUG)


def _moment(playback: Playback, text: str, option: str) -> float:
    try:
        return playback.time_of(text)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint=option) from error


def _print(playback: Playback, time: float, *, as_json: bool) -> None:
    import shutil

    from scenario_tui.cli._output import emit, out
    from scenario_tui.frame import frame

    if not as_json:
        size = shutil.get_terminal_size((80, 24))
        for line in frame(playback, time, size.columns, size.lines - 1):
            out().print(line, no_wrap=True, soft_wrap=True)
        return
    view = playback.view(time)
    names = playback.trace.scene.joint_names
    emit(
        "frame",
        run=playback.label,
        trace=str(playback.trace.path),
        time=time,
        start=playback.start,
        end=playback.end,
        pose=view.where,
        estimate=view.estimate,
        joints=dict(zip(names, view.joints, strict=True)),
        reached=view.reached,
        waypoints=playback.waypoints,
        returns=list(view.returns),
        plan=list(view.plan),
        contacts=list(view.contacts),
        verdicts=list(playback.verdicts),
    )
