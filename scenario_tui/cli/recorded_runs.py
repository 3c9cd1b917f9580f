"""Commands about recorded runs: replay them, plot their signals."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scenario_tui.cli import completion
from scenario_tui.cli.exit_codes import ExitCode, wrong_usage
from scenario_tui.cli.options import AsJson, Connect, RunOrTrace, State
from scenario_tui.cli.output import Output, OutputPart, say, stdout_console

if TYPE_CHECKING:
    from daemon.model.verdicts import Verdict
    from grammars.model.geometry import Point2, Pose2
    from scenario_tui.dashboard.playback import Playback
    from scenario_tui.terminal.capabilities import Blocks
    from scenario_tui.text.signal_plot import Curves


def replay(
    run: RunOrTrace,
    other: Annotated[
        str,
        typer.Argument(
            metavar="[OTHER]",
            help="Another run, to see both side by side.",
            autocompletion=completion.runs_or_traces,
        ),
    ] = "",
    start: Annotated[
        str,
        typer.Option(
            "--from",
            metavar="SECONDS|ORACLE",
            help="Begin there: a moment, or when that oracle was decided.",
            autocompletion=completion.oracles,
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
            help="Only print this moment as text: a time in seconds, such as 124.2, or an oracle; "
            "needs no terminal.",
            autocompletion=completion.oracles,
        ),
    ] = "",
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:  # fmt: skip
    """Watch a recorded run from above, with what its oracles say, or two of them side by side."""
    import sys

    from scenario_tui.cli.named_traces import one_trace
    from scenario_tui.cli.target import DaemonTarget
    from scenario_tui.dashboard.playback import open_playback
    from scenario_tui.terminal.capabilities import why_undrawable

    if as_json and not frame:
        raise typer.BadParameter("goes with --frame only", param_hint="--json")
    target = DaemonTarget(connect, state)
    trace = one_trace(run, target, "RUN")
    if other:
        if frame:
            raise typer.BadParameter("goes with one run only", param_hint="--frame")
        _replay_side_by_side(trace, one_trace(other, target, "OTHER"), start, speed)
        return
    # Drawn on standard error like the dashboard, with keys from standard input.
    if not frame and not (sys.stdin.isatty() and sys.stderr.isatty()):
        say("scenario: a replay needs a terminal; scripts use `scenario replay RUN --frame 10`")
        raise typer.Exit(ExitCode.BAD_INPUT)
    if not frame and (why := why_undrawable()):
        say(f"scenario: {why}")
        raise typer.Exit(ExitCode.BAD_INPUT)
    if frame:
        playback = open_playback(trace)
        _print_frame(playback, _resolve_time(playback, frame, "--frame"), as_json=as_json)
        return
    from scenario_tui.dashboard.screens.replay import ReplayScreen, run_replay

    playback = open_playback(trace)
    begin = _resolve_time(playback, start, "--from") if start else playback.start
    if run_replay(ReplayScreen(playback, begin, speed)):
        raise typer.Exit(ExitCode.BUG)


def _replay_side_by_side(first: Path, second: Path, start: str, speed: float) -> None:
    """Show two runs side by side; without a terminal print how they differ."""
    import sys

    from scenario_tui.dashboard.playback import open_playback
    from scenario_tui.terminal.capabilities import why_undrawable
    from scenario_tui.text.comparison_text import comparison_text

    both = open_playback(first), open_playback(second)
    begin = _resolve_time(both[0], start, "--from") if start else both[0].start
    if not (sys.stdin.isatty() and sys.stderr.isatty()) or why_undrawable():
        verdicts, specs = zip(*((one.verdicts, one.trace.spec) for one in both), strict=True)
        stdout_console().print(comparison_text(*verdicts, *specs), soft_wrap=True)
        return
    from scenario_tui.dashboard.screens.compare import CompareScreen
    from scenario_tui.dashboard.screens.replay import run_replay

    if run_replay(CompareScreen(*both, begin=begin, speed=speed)):
        raise typer.Exit(ExitCode.BUG)


def _resolve_time(playback: Playback, text: str, option: str) -> float:
    with wrong_usage(option):
        return playback.time_of(text)


def _print_frame(playback: Playback, time: float, *, as_json: bool) -> None:
    import shutil

    from scenario_tui.dashboard.playback import render_frame
    from scenario_tui.terminal.filters import text_in_ascii

    if as_json:
        FrameOutput.of(playback, time).emit()
        return
    size = shutil.get_terminal_size((80, 24))
    # What is printed may go anywhere: only who says so gets ASCII.
    plain = os.environ.get("SCENARIO_GLYPHS") == "ascii"
    blocks: Blocks = "cells" if plain else "quadrants"
    for line in render_frame(playback, time, size.columns, size.lines - 1, blocks=blocks):
        shown = text_in_ascii(line) if plain else line
        stdout_console().print(shown, no_wrap=True, soft_wrap=True)


class FrameOutput(Output, schema="frame"):
    """A moment of a run; ``estimate`` is where the robot believes it is."""

    run: str
    trace: str
    time: float
    start: float
    end: float
    pose: Pose2
    estimate: Pose2 | None
    joints: dict[str, float]
    reached: int
    waypoints: int
    returns: tuple[Point2, ...]
    plan: tuple[Point2, ...]
    contacts: tuple[Point2, ...]
    verdicts: tuple[Verdict, ...]

    @classmethod
    def of(cls, playback: Playback, time: float) -> FrameOutput:
        """Return the run as it was at a moment."""
        view, trace = playback.view(time), playback.trace
        return cls(
            run=playback.label,
            trace=str(trace.path),
            time=time,
            start=playback.start,
            end=playback.end,
            pose=view.where,
            estimate=view.estimate,
            joints=dict(zip(trace.scene.joint_names, view.joints, strict=True)),
            reached=view.reached,
            waypoints=playback.waypoints,
            returns=view.returns,
            plan=view.plan,
            contacts=view.contacts,
            verdicts=playback.verdicts,
        )


class PlottedCurve(OutputPart):
    """A signal over time; null where it is not known or not finite."""

    name: str
    unit: str
    time: list[float]
    values: list[float | None]


class PlotOutput(Output, schema="plot"):
    """Signals of a run, and what its oracles say."""

    run: str
    trace: str
    signals: list[PlottedCurve]
    verdicts: tuple[Verdict, ...]

    @classmethod
    def of(cls, found: Curves) -> PlotOutput:
        """Return curves as JSON can hold them."""
        trace = found.trace
        signals = [
            PlottedCurve(one.name, one.unit, one.time.tolist(), one.values.tolist())
            for one in found.curves
        ]
        return cls(trace.spec.label, str(trace.path), signals, found.verdicts)


def plot(
    run: RunOrTrace,
    signals: Annotated[
        list[str],
        typer.Argument(
            metavar="SIGNAL",
            help="Signals as oracles name them: clearance speed loc.error door_17.angle "
            "'clearance(0.35 m, 0.2 m)'.",
            autocompletion=completion.signals,
        ),
    ],
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Draw signals of a recorded run over time, with the moments that decided against it."""
    from scenario_tui.cli.named_traces import one_trace
    from scenario_tui.cli.target import DaemonTarget
    from scenario_tui.text.signal_plot import read_curves

    trace = one_trace(run, DaemonTarget(connect, state), "RUN")
    with wrong_usage("SIGNAL"):
        found = read_curves(trace, signals)
    if as_json:
        PlotOutput.of(found).emit()
    else:
        _print_curves(found)


def _print_curves(found: Curves) -> None:
    import shutil

    import numpy as np
    from rich.text import Text

    from daemon.model.verdicts import Outcome
    from grammars.text.words import format_quantity
    from scenario_tui.dashboard.signal_graphs import draw_signals
    from scenario_tui.text.formatting import glyph_word, time_text

    console = stdout_console()
    size = shutil.get_terminal_size((80, 24))
    against = [v for v in found.verdicts if v.outcome is Outcome.FAIL]
    marks = tuple(v.evidence.time for v in against if v.evidence.time is not None)
    for curve in found.curves:
        known = curve.values[np.isfinite(curve.values)]
        said = "never known in this run"
        if len(known):
            unit = "" if curve.unit == "bool" else curve.unit
            low = format_quantity(float(known.min()))
            high = format_quantity(float(known.max()), unit)
            said = f"{low} to {high}, at the end {format_quantity(float(known[-1]), unit)}"
        console.print(Text.assemble((curve.name, "bold"), f"  {said}"), soft_wrap=True)
    rows = size.lines - 1 - len(against) - len(found.curves)
    for row in draw_signals(found.trace, found.curves, size.columns, rows, marks=marks):
        console.print(row, soft_wrap=True)
    for verdict in against:
        line = f"{glyph_word(verdict.outcome)}  {verdict.oracle}"
        when = (
            f" at {time_text(verdict.evidence.time)}" if verdict.evidence.time is not None else ""
        )
        console.print(line + when, markup=False, soft_wrap=True)
