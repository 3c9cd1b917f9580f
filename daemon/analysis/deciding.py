"""Marks of verdicts on a map: the deciding object and its distance to the robot at that moment.

Pictures, reports and the dashboard show them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon

from daemon.model.spec import OracleText
from daemon.model.verdicts import Outcome, Verdict
from grammars.model.geometry import Point2, Pose2, Ring
from grammars.model.kinematics import placed_links
from grammars.model.robot import Robot
from grammars.model.scene import Link, Scene, Solid
from grammars.text.words import format_quantity
from templates.plan_shapes import MeasuredMark

if TYPE_CHECKING:
    from daemon.judging.oracles import SignalSampler
    from daemon.trace import MotionTrack, PoseTrack, Trace

_REACHED: Final = 0.25
"""Default radius [m] of a waypoint, if no oracle gives another one."""
_TOUCHING: Final = 0.002
"""Distance [m] below which two things touch: contacts are recorded a little apart."""


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
    # The dashboard marks objects of a running run too, and does not load the oracles for that.
    from daemon.judging.oracles import written_oracle
    from grammars.oracle import object_signals

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


def object_mark(
    scene: Scene, robot: Robot, verdict: Verdict, pose: Pose2,
    positions: Mapping[str, float], about: str,
) -> MeasuredMark | None:  # fmt: skip
    """Return the obstacle or place called ``about``, or the nearest obstacle without a name.

    The robot stands at ``pose``, the joints at ``positions`` [rad or m], by scene-wide name.
    """
    owned = list(_obstacle_parts(scene, robot.height, positions, about))
    parts = [rings for _, rings in owned]
    places = {region.name: region.outline for region in scene.regions}
    places |= {doorway.name: doorway.footprint for doorway in scene.doorways}
    place = () if parts else places.get(about, ())
    if not parts and not place:
        return None
    body = Polygon(pose.apply_ring(robot.footprint))
    # Choose the nearest piece of a wall, or the nearest link of an object.
    shapes = [MultiPolygon([(ring, ()) for ring in rings]) for rings in parts or [(place,)]]
    index = int(np.argmin(shapely.distance(body, shapes)))
    start, end = outline_points(shapely.shortest_line(body, shapes[index]))
    distance = body.distance(shapes[index])
    words = measure_text(verdict, distance)
    if distance < _TOUCHING and verdict.unit != "m":
        words = f"touches {about.partition('.')[0].replace('_', ' ')}".rstrip()
    name = owned[index][0] if parts else about
    return MeasuredMark(name, (start, end), words, parts[index] if parts else (), place)


def _obstacle_parts(
    scene: Scene, height: float, positions: Mapping[str, float], name: str
) -> Iterator[tuple[str, tuple[Ring, ...]]]:
    """Yield owner and outlines of each solid and link below a ``height`` [m].

    ``name`` limits them to one thing, unless it is empty.
    """
    parts: list[tuple[str, Solid | Link, tuple[Ring, ...]]] = [
        (solid.owner, solid, (solid.polygon,)) for solid in scene.solids
    ]
    for thing in scene.objects:
        for link, rings in placed_links(thing, positions):
            parts.append((f"{thing.name}.{link.name}", link, rings))
    for owner, part, rings in parts:
        is_meant = not name or owner == name or owner.startswith(f"{name}.")
        if rings and is_meant and part.z_min < height and part.z_max > 0.0:
            yield owner, rings


def outline_points(geometry: Any) -> tuple[Point2, ...]:
    """Return the points of a shape."""
    return tuple((x, y) for x, y in shapely.get_coordinates(geometry).tolist())


def measure_text(verdict: Verdict, distance: float) -> str:
    """Return the judged value with its limit if it is a length, otherwise a distance [m]."""
    value, limit = verdict.evidence.value, verdict.evidence.limit
    if verdict.unit != "m" or value is None:
        return metres_text(distance)
    return metres_text(value) if limit is None else f"{metres_text(value)}, limit {limit:g} m"


def metres_text(value: float) -> str:
    """Return a length to the millimetre, from ten metres on to the decimetre."""
    digits = 3 if abs(value) < 10.0 else 1
    return f"{value:.{digits}f} m".replace("-", "−")
