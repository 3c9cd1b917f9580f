"""A recorded run at any moment: sampled signals, the top view, a frame as lines of text."""

from __future__ import annotations

import contextlib
import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
from rich.text import Text

from daemon.model.assessments import NO_MARK, Mark
from daemon.model.live_view import blocked_points, scan_returns
from daemon.model.stack_reports import StackState
from daemon.model.sut import CostmapPicture
from daemon.model.verdicts import Outcome, Verdict
from daemon.trace import ScanTrack, Trace, TraceError, read_outputs, read_trace
from grammars.model.geometry import Floats, Point2, Pose2
from grammars.model.robot import Laser
from grammars.text.diagnostics import did_you_mean
from grammars.text.words import count_noun
from scenario_tui.dashboard.run_log import LogExcerpt, recorded_log
from scenario_tui.dashboard.run_timeline import (
    RunTimeline,
    clearance_along,
    failure_moments,
    recorded_timeline,
)
from scenario_tui.dashboard.run_watch import TRAIL_STEP
from scenario_tui.dashboard.transport import FLASH
from scenario_tui.dashboard.widgets.cell_view import text_lines
from scenario_tui.dashboard.widgets.map_frame import View, draw_view
from scenario_tui.dashboard.widgets.map_style import STYLES, MapSigns, legend_lines
from scenario_tui.text.run_text import NO_MARKS, marked_style, verdict_lines
from scenario_tui.text.styles import QUIET
from templates.plan_shapes import MeasuredMark

RAYS: Final = 120
"""Most laser returns of one scan; more of them would fall into the same dots."""
_CHROME: Final = 2
"""Lines of a frame for headline and timeline."""


class Playback:
    """A trace prepared to show any of its moments, with the ``verdicts`` to show.

    ``outputs`` are those of an external system under test by name; ``marks`` are the decisive
    objects by oracle.
    """

    def __init__(
        self,
        trace: Trace,
        verdicts: Sequence[Verdict],
        outputs: Mapping[str, str],
        marks: Mapping[str, MeasuredMark],
    ) -> None:
        way = trace.ground_truth
        if not len(way.time):
            hint = "run it again to get a recording"
            raise TraceError(trace.path, "has no poses of the robot", hint)
        self._scans = thin_scans(trace)
        self.trace = replace(trace, scans=None)
        self.verdicts = tuple(verdicts)
        self.outputs, self._marks = outputs, marks
        spec = trace.spec
        self.label = f"{spec.scenario}/{spec.sut.name}/{spec.repeat}"
        self.start, self.end = float(way.time[0]), float(way.time[-1])
        self.moments = failure_moments(verdicts)
        state = StackState()
        # Once, not for every frame: a behaviour tree reports each of its ticks.
        self._stack_lines = [state.line]
        for report in trace.reports:
            state.take(report)
            self._stack_lines.append(state.line)

    @property
    def waypoints(self) -> int:
        """The number of waypoints of the mission."""
        return len(self.trace.spec.mission.waypoints)

    def time_of(self, text: str) -> float:
        """Return the moment [s] for a number of seconds, or for an oracle when it was decided.

        Raises ``ValueError`` for other texts, and for oracles without a decisive moment.
        """
        with contextlib.suppress(ValueError):
            if not math.isnan(time := float(text)):
                return self.within(time)
        names = {verdict.oracle: verdict for verdict in self.verdicts}
        if text not in names:
            hint = did_you_mean(text, names)
            raise ValueError(f'"{text}" is neither a number of seconds nor an oracle: {hint}')
        decided = names[text].evidence.time
        if decided is None:
            raise ValueError(f'oracle "{text}" has no decisive moment: {names[text].outcome}')
        return self.within(decided)

    def within(self, time: float) -> float:
        """Return ``time``, or the nearer end of the recording."""
        return min(max(time, self.start), self.end)

    def reached(self, time: float) -> int:
        """Return the number of waypoints done at ``time``."""
        count = _count(self.trace.progress, time)
        return self.trace.progress[count - 1].reached if count else 0

    def pose(self, time: float) -> Pose2:
        """Return the pose of the robot at ``time``: the last sample until then."""
        return _pose_at(self.trace.ground_truth, _last(self.trace.ground_truth.time, time, 0))

    def estimate(self, time: float) -> Pose2 | None:
        """Return the pose estimate of the system under test, ``None`` before the first one."""
        index = _last(self.trace.estimate.time, time)
        return None if index < 0 else _pose_at(self.trace.estimate, index)

    def spread(self, time: float) -> tuple[float, float, float] | None:
        """Return the covariance of its position, by its particles, otherwise by its estimate."""
        track = self.trace.cloud if len(self.trace.cloud.time) else self.trace.estimate
        index = _last(track.time, time)
        if index < 0:
            return None
        (xx, xy), (_, yy) = track.covariance[index][:2, :2].tolist()
        return xx, xy, yy

    def joints(self, time: float) -> tuple[float, ...]:
        """Return all joint positions at ``time``, in the order of the scene."""
        resting = tuple(self.trace.scene.initial_joints.values())
        track = self.trace.joints
        if not len(track.time) or time < track.time[0]:
            return resting
        columns = track.position.T
        return tuple(float(np.interp(time, track.time, column)) for column in columns)

    def view(self, time: float, *, window: float = FLASH, verdict: Verdict | None = None) -> View:
        """Return the top view at ``time`` [s], with the contacts of the ``window`` before it.

        It marks the object that decided ``verdict`` if that was in the window, too. Without a
        verdict it marks the last failure.
        """
        trace, here = self.trace, self.pose(time)
        plans = trace.plans[: _count(trace.plans, time)]
        touched = (c.point for c in trace.contacts if time - window < c.time <= time)
        times, trail, clearances, limit = self._trail
        count = int(np.searchsorted(times, time + 1e-9, side="right"))
        # The robot has the clearance of the last point of its trail.
        clearances = (*clearances[:count], *clearances[count - 1 : count])
        return View(
            trace.scene,
            trace.spec.robot,
            trace.spec.mission,
            self.joints(time),
            here,
            self.estimate(time),
            self.reached(time),
            (*trail[:count], (here.x, here.y)),
            self._returns(time),
            tuple((x, y) for x, y in plans[-1].points.tolist()) if plans else (),
            tuple(dict.fromkeys(touched)),
            self.spread(time),
            clearances,
            limit,
            self._costmaps(time),
            self._decisive(time, window, verdict),
        )

    def _decisive(self, time: float, window: float, verdict: Verdict | None) -> MeasuredMark | None:
        failures = [one for one in self.verdicts if one.outcome is Outcome.FAIL]
        # The end of the run decides about an event that never happened.
        moments = {
            one.oracle: self.end if one.moment is None else one.moment
            for one in ([verdict] if verdict else failures)
        }
        recent = [o for o, moment in moments.items() if time - window < moment <= time + 1e-9]
        return self._marks.get(max(recent, key=moments.__getitem__, default=""))

    def stack_line(self, time: float) -> str:
        """Return the last report of the stack until ``time``, empty without reports."""
        return self._stack_lines[_count(self.trace.reports, time)]

    def _costmaps(self, time: float) -> dict[str, Floats]:
        """Return the cells of each costmap that block the robot (n, 2) [m], by its scope."""
        latest = {c.scope: c for c in self.trace.costmaps if c.time <= time + 1e-9}
        # The default is no costmap, unless the user asked to record some.
        first: dict[str, Floats] = {} if self.trace.spec.sut.recorded else {"": np.empty((0, 2))}
        return first | {
            scope: blocked_points(latest[scope], self._frame_pose(latest[scope]))
            for scope in sorted(latest, reverse=True)
        }

    def _frame_pose(self, costmap: CostmapPicture) -> Pose2:
        """Return the frame of a costmap in the map, by the stack's own localisation then."""
        if costmap.frame == "map":
            return Pose2()
        estimate, odometry = self.trace.estimate, self.trace.odometry
        index = _last(estimate.time, costmap.time)
        believed = self.trace.spec.mission.start if index < 0 else _pose_at(estimate, index)
        moment = self.start if index < 0 else float(estimate.time[index])
        return believed @ _pose_at(odometry, _last(odometry.time, moment, 0)).inverse()

    @cached_property
    def log(self) -> LogExcerpt:
        """Log lines, decisions and waypoints, by time."""
        return recorded_log(self.trace, self.moments, self.timeline.doors or (), self.outputs)

    @cached_property
    def timeline(self) -> RunTimeline:
        """Signals, doors and mission along time."""
        return recorded_timeline(self.trace, [moment.time for moment in self.moments])

    @cached_property
    def _trail(self) -> tuple[Floats, tuple[Point2, ...], tuple[float, ...], float | None]:
        """Times, places and clearances of the trail, some centimetres apart, and the limit."""
        way = self.trace.ground_truth
        ways = np.hypot(np.diff(way.x, prepend=way.x[:1]), np.diff(way.y, prepend=way.y[:1]))
        # By distance, not by time: a waiting robot adds no points, a fast one leaves no gaps.
        passed = np.floor(np.cumsum(ways) / TRAIL_STEP)
        steps = np.flatnonzero(np.diff(passed, prepend=-1.0) > 0)
        times = way.time[steps]
        places = zip(way.x[steps].tolist(), way.y[steps].tolist(), strict=True)
        return times, tuple(places), *clearance_along(self.timeline.signals, times)

    def _returns(self, time: float) -> tuple[Point2, ...]:
        """Return the returns of each laser, from the robot's pose at that scan."""
        returns: list[Point2] = []
        for laser, scans in self._scans:
            index = _last(scans.time, time)
            if index < 0:
                continue
            # Not from the present pose: a scan is older by up to its period.
            base = self.pose(float(scans.time[index]))
            x, y = scan_returns(laser, base, scans.ranges[index], RAYS).T.tolist()
            returns += zip(x, y, strict=True)
        return tuple(returns)


def thin_scans(trace: Trace) -> tuple[tuple[Laser, ScanTrack], ...]:
    """Return each laser with at most :data:`RAYS` of its rays, and their scans.

    Otherwise a minute of a laser with 500 rays takes 1.2 MB, mostly invisible.
    """
    thinned = []
    for laser, scans in zip(trace.spec.robot.lasers, trace.scans or (), strict=False):
        step = max(1, -(-laser.rays // RAYS))
        bearings = np.linspace(laser.angle_min, laser.angle_max, laser.rays)[::step]
        first, last = float(bearings[0]), float(bearings[-1])
        fewer = replace(laser, rays=len(bearings), angle_min=first, angle_max=last)
        ranges = np.ascontiguousarray(scans.ranges[:, ::step])
        thinned.append((fewer, replace(scans, ranges=ranges)))
    return tuple(thinned)


def _last(stamps: Floats, time: float, least: int = -1) -> int:
    """Return the index of the last stamp until ``time``, at least ``least``."""
    # A summed or typed moment may lie a rounding error before its sample.
    return max(int(np.searchsorted(stamps, time + 1e-9, side="right")) - 1, least)


def _count(records: Sequence[Any], time: float) -> int:
    """Return the number of records until ``time``."""
    return bisect_right(records, time + 1e-9, key=lambda record: record.time)


def _pose_at(track: object, index: int) -> Pose2:
    x, y, yaw = (float(getattr(track, name)[index]) for name in ("x", "y", "yaw"))
    return Pose2(x, y, yaw)


def open_playback(path: Path, verdicts: Sequence[Verdict] | None = None) -> Playback:
    """Read a trace to play it; without ``verdicts``, judge it by its own oracles.

    Raises :class:`daemon.trace.TraceError` for an unusable trace.
    """
    from daemon.analysis.deciding import deciding_mark, robot_mark
    from daemon.judging.oracles import SignalSampler, judge, trace_problems

    trace = read_trace(path, scans=True, views=True)
    if verdicts is None:
        verdicts = judge(trace, trace.spec.oracles)
    marks = {}
    if not trace_problems(trace):
        sampler = SignalSampler(trace)
        marks = {v.oracle: deciding_mark(sampler, v) or robot_mark(sampler, v) for v in verdicts}
    return Playback(trace, verdicts, read_outputs(path), marks)


def read_playback(path: Path, verdicts: Sequence[Verdict]) -> Playback:
    """Read a trace and sample its signals; for the child process of the dashboard.

    Raises :class:`daemon.trace.TraceError` for an unusable trace, and for errors of plug-ins.
    """
    try:
        playback = open_playback(path, verdicts)
        playback.timeline  # noqa: B018  sampled here, where the screen does not wait for it
    except TraceError:
        raise
    except Exception as error:
        raise TraceError(path, f"cannot be shown: {type(error).__name__}: {error}") from error
    return playback


def headline(playback: Playback, time: float) -> str:
    """Return the first line: the moment, the duration, the progress of the mission."""
    done = f"reached {playback.reached(time)} of {count_noun(playback.waypoints, 'waypoint')}"
    state = "" if playback.trace.complete else "  (recording was cut)"
    return f"{playback.label}  {time:.1f} s of {playback.end:.1f} s  {done}{state}"


def timeline_bar(
    playback: Playback, time: float, width: int, marks: Mapping[str, Mark] = NO_MARKS
) -> Text:
    """Return the whole run as a line, with a dot at ``time`` and ✗ at the failure of an oracle.

    ``marks`` tell known failures, which are amber and stand behind new ones.
    """
    span = max(playback.end - playback.start, 1e-9)

    def cell(at: float) -> int:
        return round((playback.within(at) - playback.start) / span * (width - 1))

    now = cell(time)
    signs = [*"━" * now, "●", *"─" * (width - 1 - now)]
    styles = [(marked_style("fail", marks.get(m.oracle, NO_MARK)), m) for m in playback.moments]
    decided = {cell(m.time): style for style, m in sorted(styles, key=lambda one: one[0] == "fail")}
    # Over the line and the dot, so that the dot hides no failure.
    for at in decided:
        signs[at] = "✗"
    text = Text("".join(signs), style=QUIET)
    for at, style in decided.items():
        text.stylize(style, at, at + 1)
    return text


def lines_below(
    playback: Playback, time: float, marks: Mapping[str, Mark] = NO_MARKS
) -> list[Text]:
    """Return the lines below the map: the report of the stack, and the marked verdicts."""
    stack, lines = playback.stack_line(time), verdict_lines(playback.verdicts, time, marks=marks)
    return [*([Text(stack, style=QUIET)] if stack else ()), *lines]


def render_frame(
    playback: Playback,
    time: float,
    width: int,
    height: int,
    *,
    verdict: Verdict | None = None,
    marks: Mapping[str, Mark] = NO_MARKS,
) -> list[Text]:
    """Return the frame at ``time`` [s] as lines that fit into ``width`` x ``height`` cells.

    The object that decides ``verdict`` is marked, see :meth:`Playback.view`. ``marks`` belong to
    the verdicts.
    """
    below, view = lines_below(playback, time, marks), playback.view(time, verdict=verdict)
    # Draw once to find the legend and its number of lines.
    rows = max(3, height - _CHROME - len(below) - 1)
    layers = draw_view(view, width, rows).layers
    signs = MapSigns(layers, view.limit, view.decisive.name if view.decisive else "")
    legend = legend_lines([signs], width, height)
    rows = max(3, rows - (len(legend) - 1))
    codes, owners = draw_view(view, width, rows).cells()
    bar = timeline_bar(playback, time, width, marks)
    lines = [Text(headline(playback, time), style="bold"), bar]
    lines += [*text_lines(codes, owners, STYLES), *below, *legend]
    for line in lines:
        line.truncate(width, overflow="ellipsis")
    return lines
