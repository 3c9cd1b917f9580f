"""The moment of a run that decided a verdict: the robot, what was around it, what was involved."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from daemon.analysis.report._axes import Axes, Sheet
from daemon.analysis.report._recorded import sampled_trace
from daemon.analysis.report._safety_buffer import outlines_near, transform_points
from daemon.analysis.report._svg import BAD, BODY, LINE, SECOND, SOFT, WALL
from daemon.trace import TraceError
from grammars.model.geometry import Floats, Point2

_WIDE, _HIGH = 3.2, 2.0
"""Half of what is shown [m]."""
_WAY_SHOWN: Final = 10.0
"""Seconds of the way there that are shown."""


def plot_moment(trace: Path, time: float, involved: str, buffer: Point2) -> Sheet | None:
    """Return the place at ``time`` [s] of a run, the object ``involved`` in red.

    ``None`` if the trace cannot be read any more.
    """
    try:
        sampler = sampled_trace(trace)
    except TraceError:
        return None
    stamps = sampler.time_base.time
    index = min(int(np.searchsorted(stamps, time)), len(stamps) - 1)
    pose = sampler.poses[index]
    sheet = Sheet(3.5, 3.5 * _HIGH / _WIDE, bare=True)
    (axes,) = sheet.axes
    for owner, moves, ring in outlines_near(sampler, index, float(np.hypot(_WIDE, _HIGH))):
        colour = BAD if owner == involved else SECOND if moves else WALL
        axes.shapes([ring], fill=colour, edge=colour, width=0.5)
    first = int(np.searchsorted(stamps, time - _WAY_SHOWN))
    axes.line(sampler.x[first : index + 1], sampler.y[first : index + 1], LINE, 1.2)
    _draw_robot(axes, np.array(sampler.trace.spec.robot.footprint), pose, buffer)
    axes.x_limits = (float(pose[0]) - _WIDE, float(pose[0]) + _WIDE)
    axes.y_limits = (float(pose[1]) - _HIGH, float(pose[1]) + _HIGH)
    axes.equal = True
    return sheet


def _draw_robot(axes: Axes, footprint: Floats, pose: Floats, buffer: Point2) -> None:
    hx, hy = buffer
    box = np.array([(hx, hy), (-hx, hy), (-hx, -hy), (hx, -hy), (hx, hy)])
    ahead = np.array([(0.0, 0.0), (0.7 * float(footprint[:, 0].max()), 0.0)])
    around, body, nose = (
        transform_points(points, pose[None]) for points in (box, footprint, ahead)
    )
    axes.line(around[:, 0], around[:, 1], SOFT, 0.9, dashes="4 3")
    axes.shapes([body], fill=BODY, edge=BODY, width=1.0, alpha=0.55)
    axes.line(nose[:, 0], nose[:, 1], BODY, 2.0)
