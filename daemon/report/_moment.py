"""The moment that decided: robot, walls and doors as they stood then, and the way there."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from daemon.oracles import Sampler
from daemon.report._buffer import outlines_near
from daemon.report._svg import BAD, BODY, LINE, SECOND, SOFT, WALL, figure, to_svg
from daemon.trace import TraceError, read_trace
from grammars.values import Floats, Point2

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_WIDE, _HIGH = 3.2, 2.0
"""Half of what is shown [m]."""
_BEFORE: Final = 10.0
"""Seconds of the way there that are shown."""


def moment(name: str, label: str, trace: Path, time: float, involved: str, buffer: Point2) -> str:
    """Return the place at ``time`` [s] of a run, the object ``involved`` in red; empty if the trace
    cannot be read any more.
    """
    try:
        recorded = read_trace(trace)
    except TraceError:
        return ""
    sampler = Sampler(recorded)
    stamps = sampler.timeline.time
    index = min(int(np.searchsorted(stamps, time)), len(stamps) - 1)
    pose = sampler.poses[index]
    sheet, axes = figure(3.5, 3.5 * _HIGH / _WIDE, bare=True)
    for owner, moves, ring in outlines_near(sampler, index, float(np.hypot(_WIDE, _HIGH))):
        colour = BAD if owner == involved else SECOND if moves else WALL
        axes.fill(ring[:, 0], ring[:, 1], facecolor=colour, edgecolor=colour, lw=0.5)
    first = int(np.searchsorted(stamps, time - _BEFORE))
    axes.plot(sampler.x[first : index + 1], sampler.y[first : index + 1], color=LINE, lw=1.2)
    _robot(axes, np.array(recorded.spec.robot.footprint), pose, buffer)
    axes.set(
        xlim=(pose[0] - _WIDE, pose[0] + _WIDE),
        ylim=(pose[1] - _HIGH, pose[1] + _HIGH),
        aspect="equal",
    )
    axes.set_axis_off()
    return to_svg(sheet, name, label)


def _robot(axes: Axes, footprint: Floats, pose: Floats, buffer: Point2) -> None:
    hx, hy = buffer
    box = np.array([(hx, hy), (-hx, hy), (-hx, -hy), (hx, -hy), (hx, hy)])
    around, body = _placed(box, pose), _placed(footprint, pose)
    nose = _placed(np.array([(0.0, 0.0), (0.7 * float(footprint[:, 0].max()), 0.0)]), pose)
    axes.plot(around[:, 0], around[:, 1], color=SOFT, lw=0.9, ls=(0, (4, 3)))
    axes.fill(body[:, 0], body[:, 1], facecolor=BODY, edgecolor=BODY, alpha=0.55)
    axes.plot(nose[:, 0], nose[:, 1], color=BODY, lw=2.0)


def _placed(points: Floats, pose: Floats) -> Any:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return points @ np.array([(c, s), (-s, c)]) + pose[:2]
