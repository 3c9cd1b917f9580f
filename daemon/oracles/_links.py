"""Where the joints and links of scenery objects are, over a whole trace at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from daemon.oracles._kernel import cos_sin
from grammars import kinematics
from grammars.kinematics import WORLD
from grammars.scene import Joint, SceneObject
from grammars.values import Floats

if TYPE_CHECKING:
    from daemon.trace import Trace


def joint_positions(trace: Trace, obj: SceneObject, time: Floats) -> Floats:
    """Return recorded positions (n, joints) of ``obj`` [rad or m] on ``time`` (n,).

    Between recorded samples positions are interpolated, as :class:`daemon.trace.JointTrack` asks;
    joints stand at their initial position until first recorded.
    """
    track = trace.joints
    column = {name: index for index, name in enumerate(track.names)}
    positions = np.empty((len(time), len(obj.joints)))
    for index, (joint, initial) in enumerate(zip(obj.joints, obj.initial, strict=True)):
        name = f"{obj.name}.{joint.name}"
        if name not in column or not len(track.time):
            positions[:, index] = initial
            continue
        recorded = track.position[:, column[name]]
        positions[:, index] = np.interp(time, track.time, recorded, left=initial)
    return positions


def link_tracks(obj: SceneObject, positions: Floats) -> dict[str, Floats]:
    """Return :func:`grammars.kinematics.link_tracks`, compiled where it is slow.

    Most doors never move: theirs are computed once and cannot be written to.
    """
    if len(positions) < 2 or (positions != positions[:1]).any():
        return kinematics.link_tracks(obj, positions, cos_sin)
    once = kinematics.link_tracks(obj, positions[:1], cos_sin)
    return {name: np.broadcast_to(track, (len(positions), 3)) for name, track in once.items()}


def hinge_foot(obj: SceneObject, joint: Joint, positions: Floats) -> tuple[Floats, Floats]:
    """Return where the anchor of ``joint`` is in the world over time: x (n,), y (n,) [m]."""
    if joint.parent == WORLD:
        parent = np.tile((obj.pose.x, obj.pose.y, obj.pose.yaw), (len(positions), 1))
    else:
        parent = link_tracks(obj, positions)[joint.parent]
    c, s = cos_sin(parent[:, 2].copy())
    x, y = joint.anchor
    return parent[:, 0] + c * x - s * y, parent[:, 1] + s * x + c * y
