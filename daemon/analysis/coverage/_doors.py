"""Doors of a building: which moved, were triggered, and were met by the robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from daemon.analysis.coverage._results import DoorCount
from daemon.analysis.coverage._rules import MOVED
from daemon.trace import Trace
from grammars.model.behaviour import Hold, JointEvent, joint_event
from grammars.model.geometry import Point2
from grammars.model.movers import is_mover, own_joints
from grammars.model.scene import SceneObject


@dataclass(frozen=True, slots=True)
class DoorRun:
    """An articulated object in one recorded run; ``nearest`` [m], infinite without poses."""

    door: str
    planned: bool
    moved: bool
    triggered: bool
    nearest: float


def door_runs(trace: Trace) -> tuple[DoorRun, ...]:
    """Return each articulated object of the scene as a recorded run has moved it.

    Those are the objects with a joint that has room to move, movers excluded.
    """
    moving = {b.joint for b in trace.spec.behaviours if not isinstance(b, Hold)}
    by_robot = (JointEvent.TRIGGERED, JointEvent.REACTS)
    acted = {e.source for e in trace.events if joint_event(e.text) in by_robot}
    runs = []
    for door in trace.scene.objects:
        joints = {f"{door.name}.{joint.name}" for joint in own_joints(door.joints)}
        if joints and not is_mover(door.joints):
            planned, triggered = bool(joints & moving), bool(joints & acted)
            moved, nearest = _has_moved(trace, joints), _nearest_distance(trace, door)
            runs.append(DoorRun(door.name, planned, moved, triggered, nearest))
    return tuple(runs)


def _has_moved(trace: Trace, joints: set[str]) -> bool:
    columns = [i for i, name in enumerate(trace.joints.names) if name in joints]
    # From where it started, not from the last sample: a slow door moves little between two.
    position = trace.joints.position[:, columns]
    return bool(position.size and (np.abs(position - position[0]) > MOVED).any())


def _nearest_distance(trace: Trace, door: SceneObject) -> float:
    truth = trace.ground_truth
    ways = [np.hypot(truth.x - x, truth.y - y) for x, y in _meeting_points(door)]
    return min((float(way.min()) for way in ways if len(way)), default=float("inf"))


def _meeting_points(door: SceneObject) -> tuple[Point2, ...]:
    """Return the points of a door to be near to: its hinges as placed, otherwise its origin."""
    hinges = [joint for joint in own_joints(door.joints) if joint.kind == "revolute"]
    anchors = [door.pose.apply(joint.anchor) for joint in hinges]
    return tuple(anchors) or ((door.pose.x, door.pose.y),)


def door_counts(scene: str, runs: Sequence[tuple[DoorRun, ...]], near: float) -> list[DoorCount]:
    """Sum up the doors of one scene over its recorded ``runs``; met is within ``near`` [m]."""
    counts = []
    for one in zip(*runs, strict=True):
        nearest = min(run.nearest for run in one)
        counts.append(
            DoorCount(
                scene=scene,
                door=one[0].door,
                runs=len(one),
                planned=sum(run.planned for run in one),
                moved=sum(run.moved for run in one),
                triggered=sum(run.triggered for run in one),
                met=sum(run.nearest <= near for run in one),
                nearest=nearest if np.isfinite(nearest) else None,
            )
        )
    return counts
