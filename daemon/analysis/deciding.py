"""Marks of verdicts on a map: the deciding object and its distance to the robot at that moment.

Pictures, reports and the dashboard show them.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np
import shapely

from daemon.analysis.object_marks import measure_text, object_mark, outline_points
from daemon.judging.oracles import SignalSampler, written_oracle
from daemon.model.spec import OracleText
from daemon.model.verdicts import Outcome, Verdict
from daemon.trace import MotionTrack, PoseTrack, Trace
from grammars.model.geometry import Pose2
from grammars.oracle import object_signals
from grammars.text.words import format_quantity
from templates.plan_shapes import MeasuredMark

_REACHED: Final = 0.25
"""Default radius [m] of a waypoint, if no oracle gives another one."""


def deciding_mark(sampler: SignalSampler, verdict: Verdict) -> MeasuredMark | None:
    """Return the object that decides a verdict, and its distance to the robot at that moment.

    ``None`` if the verdict has no object with a place.
    """
    mark = _find_mark(sampler, verdict)
    return mark and replace(mark, fails=verdict.outcome is Outcome.FAIL)


def robot_mark(sampler: SignalSampler, verdict: Verdict) -> MeasuredMark:
    """Return the robot at the deciding moment of a verdict, with a margin that has a unit."""
    trace = sampler.trace
    pose = pose_at(trace.ground_truth, deciding_time(sampler, verdict))
    place, outline = (pose.x, pose.y), pose.apply_ring(trace.spec.robot.footprint)
    margin = format_quantity(verdict.margin, verdict.unit, signed=True) if verdict.unit else ""
    words = f"{verdict.oracle} {margin}".rstrip()
    fails = verdict.outcome is Outcome.FAIL
    return MeasuredMark("robot", (place, place), words, place=outline, fails=fails)


def _find_mark(sampler: SignalSampler, verdict: Verdict) -> MeasuredMark | None:
    trace, time = sampler.trace, deciding_time(sampler, verdict)
    pose = pose_at(trace.ground_truth, time)
    oracle = written_oracle(OracleText(verdict.oracle, verdict.text))
    # An unreadable oracle was judged by another version of the language.
    signals = [signal.name for signal in oracle.signals()] if oracle else []
    moved = object_signals(trace.scene)
    about = verdict.evidence.object
    about = about or next((moved[name].object.name for name in signals if name in moved), "")
    kinds = {name.partition(".")[0] for name in signals}
    waypoints = enumerate(trace.spec.mission.waypoints, start=1)
    number = next((number for number, waypoint in waypoints if waypoint.id == about), None)
    if not about and "mission" in kinds:
        number = current_waypoint(trace, time)
    if number:
        return _waypoint_mark(trace, verdict, pose, number)
    if about or kinds & {"clearance", "distance", "contact"}:
        positions = joint_positions(trace, time)
        return object_mark(trace.scene, trace.spec.robot, verdict, pose, positions, about)
    if "loc" in kinds and len(trace.estimate.time):
        believed = pose_at(trace.estimate, time)
        line = ((pose.x, pose.y), (believed.x, believed.y))
        return MeasuredMark("estimate", line, measure_text(verdict, math.dist(*line)))
    return None


def _waypoint_mark(trace: Trace, verdict: Verdict, pose: Pose2, number: int) -> MeasuredMark:
    waypoint = trace.spec.mission.waypoints[number - 1]
    line = ((pose.x, pose.y), (waypoint.x, waypoint.y))
    radius = verdict.unit == "m" and verdict.evidence.limit
    place = outline_points(shapely.Point(line[1]).buffer(radius or _REACHED).exterior)
    words = f"waypoint {number}: {measure_text(verdict, math.dist(*line))}"
    return MeasuredMark(f"waypoint {number}", line, words, place=place)


def deciding_time(sampler: SignalSampler, verdict: Verdict) -> float:
    """Return the deciding moment [s]; the end for something that never happened."""
    time = verdict.evidence.time
    return float(sampler.time_base.time[-1]) if time is None else time


def joint_positions(trace: Trace, time: float) -> dict[str, float]:
    """Return the positions of joints [rad or m] at a moment, by scene-wide name."""
    joints = trace.joints
    return {
        name: float(np.interp(time, joints.time, joints.position[:, index]))
        for index, name in enumerate(joints.names)
        if len(joints.time)
    }


def current_waypoint(trace: Trace, time: float) -> int | None:
    """Return the number, from 1, of the waypoint that the robot drives to at a moment."""
    current = [record.current for record in trace.progress if record.time <= time]
    if not current or not 0 <= current[-1] < len(trace.spec.mission.waypoints):
        return None
    return current[-1] + 1


def pose_at(track: MotionTrack | PoseTrack, time: float) -> Pose2:
    """Return the last recorded pose at or before a moment."""
    index = max(int(np.searchsorted(track.time, time, side="right")) - 1, 0)
    return Pose2(float(track.x[index]), float(track.y[index]), float(track.yaw[index]))
