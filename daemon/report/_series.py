"""What one trace says: tracks for the figures and numbers for the tables, by the oracles' signals.

Nothing here computes a signal of its own: the same samples that were judged are drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from daemon.oracles import Sampler
from daemon.report._buffer import points_inside
from daemon.report._passing import passings
from daemon.report._types import Buffer, Driven, Thin, Watch
from grammars.oracle import Dimension, Number, Signal
from grammars.values import Floats, Point2

if TYPE_CHECKING:
    from daemon.trace import Trace

Indices = npt.NDArray[np.int64]

_ROBOT: Final = "robot"
_METRE: Final = Dimension((1, 0, 0, 0))


@dataclass(frozen=True, slots=True)
class Measure:
    """A number every run has: what it is called, its unit, what it is in words."""

    name: str
    unit: str
    about: str

    @property
    def localisation(self) -> bool:
        """Whether it is about where the robot believed to be."""
        return self.name.startswith(("error", "inside"))


MEASURES: Final = (
    Measure("duration", "s", "simulated time from the start of the run to its end"),
    Measure("path length", "m", "length of the way the robot really went"),
    Measure("min clearance", "m", "nearest an obstacle came to the box around the footprint"),
    Measure("time in buffer", "s", "time with an obstacle inside the safety buffer"),
    Measure("longest in buffer", "s", "longest such time without a break"),
    Measure("error mean", "m", "localisation error, mean over time"),
    Measure("error median", "m", "localisation error, half of the time below"),
    Measure("error p95", "m", "localisation error, 95 % of the time below"),
    Measure("error max", "m", "largest localisation error"),
    Measure("inside 2 sigma", "%", "share of time with the true position within two deviations"),
    Measure("speed at trigger", "m/s", "speed when a door was triggered, mean over the triggers"),
    Measure("max speed in buffer", "m/s", "highest speed with an obstacle inside the buffer"),
)
"""The measures of every run; one that says nothing about a run (no estimate, no door) is left out
of it."""


def driven(
    run: str, trace: Trace, sampler: Sampler, buffer: Buffer, watches: Sequence[Watch], points: int
) -> Driven:
    """Return what ``trace`` says, thinned to about ``points`` samples for drawing."""
    timeline = sampler.timeline
    if not len(timeline.time):
        return Driven(run, problem="nothing was recorded")
    centre, body, half, limit = _boxes(trace, buffer)
    clearance = _signal(sampler, "clearance")
    inside = clearance - limit
    if buffer.half is not None and not _even(body, half, centre):
        inside = _signal(sampler, "clearance", *half)
    error, sigma_x, sigma_y = (
        _signal(sampler, name) for name in ("loc.error", "loc.sigma.x", "loc.sigma.y")
    )
    kept = thinned(clearance, error, points)
    passed = passings(trace, sampler, watches)
    speeds = [p.speed_then for p in passed if p.fired]
    measures = {
        "duration": timeline.end - timeline.start,
        "path length": float(_signal(sampler, "path.length")[-1]),
        **_nearness(sampler, clearance, inside),
        **_localisation(sampler, error),
        **({"speed at trigger": float(np.mean(speeds))} if speeds else {}),
    }
    return Driven(
        run=run,
        footprint=trace.spec.robot.footprint,
        body=body,
        buffer=half,
        limit=limit,
        time=_thin(timeline.time, kept),
        x=_thin(sampler.x, kept),
        y=_thin(sampler.y, kept),
        clearance=_thin(clearance, kept),
        error=_thin(error, kept),
        sigma_x=_thin(sigma_x, kept),
        sigma_y=_thin(sigma_y, kept),
        inside=points_inside(sampler, inside, centre if buffer.half is None else (0.0, 0.0), half),
        contacts=_contacts(trace),
        passings=passed,
        measures={name: value for name, value in measures.items() if np.isfinite(value)},
        scene=trace.spec.scene,
    )


def _boxes(trace: Trace, buffer: Buffer) -> tuple[Point2, Point2, Point2, float]:
    """Return centre and half extents of the footprint's box, the buffer's, and their distance."""
    xs, ys = zip(*trace.spec.robot.footprint, strict=True)
    centre = ((max(xs) + min(xs)) / 2.0, (max(ys) + min(ys)) / 2.0)
    body = ((max(xs) - min(xs)) / 2.0, (max(ys) - min(ys)) / 2.0)
    if buffer.half is None:
        return centre, body, (body[0] + buffer.margin, body[1] + buffer.margin), buffer.margin
    limit = min(buffer.half[0] - body[0], buffer.half[1] - body[1])
    return centre, body, buffer.half, limit


def _even(body: Point2, half: Point2, centre: Point2) -> bool:
    """Whether the buffer is equally wide on all sides: then one clearance gives the other."""
    along, across = half[0] - body[0], half[1] - body[1]
    return abs(along - across) < 1e-9 and max(map(abs, centre)) < 1e-9


def _signal(sampler: Sampler, name: str, *arguments: float) -> Floats:
    numbers = tuple(Number(value, _METRE, f"{value} m") for value in arguments)
    return sampler.sample(Signal(name, numbers)).values


def _nearness(sampler: Sampler, clearance: Floats, inside: Floats) -> dict[str, float]:
    if np.isnan(clearance).all():
        return {}
    weight = sampler.timeline.weight
    within = inside < 0.0
    found = {
        "min clearance": float(np.nanmin(clearance)),
        "time in buffer": float(weight[within].sum()),
        "longest in buffer": _longest(within, weight),
    }
    if within.any():
        found["max speed in buffer"] = float(_signal(sampler, "speed")[within].max())
    return found


def _longest(held: npt.NDArray[np.bool_], weight: Floats) -> float:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], held.astype(np.int8), [0]))))
    total = np.concatenate(([0.0], np.cumsum(weight)))
    spans = total[edges[1::2]] - total[edges[::2]]
    return float(spans.max()) if len(spans) else 0.0


def _localisation(sampler: Sampler, error: Floats) -> dict[str, float]:
    """Return the distribution of the error, every value weighed by how long it held."""
    known = ~np.isnan(error)
    weight = sampler.timeline.weight * known
    if not weight.sum() > 0.0:
        return {}
    values, share = error[known], weight[known]
    order = np.argsort(values, kind="stable")
    passed = np.cumsum(share[order]) / share.sum()
    found: dict[str, float] = {}
    for name, quantile in (("median", 0.5), ("p95", 0.95)):
        index = min(int(np.searchsorted(passed, quantile)), len(order) - 1)
        found[f"error {name}"] = float(values[order[index]])
    found |= {"error mean": float(np.average(values, weights=share))}
    found |= {"error max": float(values.max())}
    inside = _signal(sampler, "loc.inside_2sigma")
    known = ~np.isnan(inside)
    if (sampler.timeline.weight * known).sum() > 0.0:
        covered = np.average(inside[known], weights=sampler.timeline.weight[known])
        found["inside 2 sigma"] = 100.0 * float(covered)
    return found


def thinned(clearance: Floats, error: Floats, points: int) -> Indices:
    """Return the indices of about ``points`` samples that keep every dip and every peak.

    Of each stretch the first sample, the least clearance and the largest error are kept.
    """
    count = len(clearance)
    width = max(1, -(-3 * count // points))
    if width <= 2:
        return np.arange(count)
    starts = np.arange(0, count, width)
    padded = -(-count // width) * width - count

    def worst(values: Floats) -> Indices:
        whole = np.append(np.nan_to_num(values, nan=-np.inf), np.full(padded, -np.inf))
        found: Indices = starts + whole.reshape(-1, width).argmax(axis=1)
        return found

    kept = np.concatenate((starts, worst(-clearance), worst(error), [count - 1]))
    return np.unique(kept)


def _thin(values: Floats, kept: Indices) -> Thin:
    thin: Thin = values[kept].astype(np.float32)
    return thin


def _contacts(trace: Trace) -> tuple[tuple[float, str, float, float], ...]:
    """Return when and where the robot touched what; one entry for each second and object."""
    found: dict[tuple[int, str], tuple[float, str, float, float]] = {}
    for record in trace.contacts:
        if _ROBOT in (record.first, record.second):
            other = record.second if record.first == _ROBOT else record.first
            entry = (record.time, other, record.point[0], record.point[1])
            found.setdefault((int(record.time), other), entry)
    return tuple(found.values())
