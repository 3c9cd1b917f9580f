"""Signals that lead where those of the oracle language are flat.

``contact`` is true or false: the clearance leads to it, and the depth once the robot touches. The
way to the border of the place leads to ``in``, the remainder of two standard deviations to
``loc.inside_2sigma``. ``contact.depth`` and ``distance`` continue below 0.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import shapely
from shapely.geometry import Polygon

from daemon.judging.oracles._distance import nearest_polygons, place_outline
from daemon.judging.oracles._obstacles import footprint_box, obstacles_named
from daemon.judging.oracles._sampler import SignalSampler
from daemon.judging.oracles._series import SignalSeries
from grammars.model.geometry import Ring
from grammars.oracle import Signal, obstacle_names, thing_of
from grammars.text.expressions import Expression, Function

_NEAR: Final = 0.5
"""Distance [m] up to which the outline of the robot counts instead of the box around it."""


def leading_flag(signal: Signal, sampler: SignalSampler) -> SignalSeries | None:
    """Return the length [m] that leads to a true-or-false signal; ``None`` if there is none.

    It is larger the truer the signal is.
    """
    match signal.name:
        case "contact":
            return _contact(_thing(signal), sampler)
        case "loc.inside_2sigma":
            return sampler.localisation.inside_margin()
        case "in":
            return _inside(signal, sampler)
    return None


def leading_quantity(expression: Expression, sampler: SignalSampler) -> SignalSeries | None:
    """Return a signal continued below 0, ``None`` if it is not flat there.

    It must stand alone: below 0 a product or a magnitude would change its meaning.
    """
    match expression:
        case Function(name="-", operands=(operand,)):
            signal = leading_quantity(operand, sampler)
            if signal is not None:
                return SignalSeries(-signal.values, signal.objects, signal.names, signal.note)
        case Signal(name="contact.depth"):
            return _contact(_thing(expression), sampler)
        case Signal(name="distance"):
            return _distance(expression, sampler)
    return None


def _thing(signal: Signal) -> str:
    thing = thing_of(signal)
    return thing.name if thing is not None else ""


def _contact(thing: str, sampler: SignalSampler) -> SignalSeries:
    """Return the depth [m] in contact, otherwise minus the clearance; -inf without obstacles."""
    named = (Signal(thing),) if thing else ()
    touched = sampler.sample(Signal("contact.depth", named))
    objects = touched.objects
    if objects is None:
        raise TypeError("contacts are always with something")
    touching = objects >= 0
    near = sampler.sample(Signal("clearance", named))
    clear = _refine(near, thing, sampler)
    # The recorded contact decides: one between two samples may be over at the next one, and the
    # physics lets things overlap a little before it reports a contact.
    values = np.where(touching, touched.values, -np.maximum(clear.values, 0.0))
    values = np.where(np.isnan(values), -np.inf, values)
    if clear.objects is None:
        return SignalSeries(values, objects, touched.names)
    nearest = np.where(clear.objects >= 0, clear.objects + len(touched.names), -1)
    both = np.where(touching, objects, nearest).astype(np.int32)
    return SignalSeries(values, both, (*touched.names, *clear.names))


def _distance(signal: Signal, sampler: SignalSampler) -> SignalSeries:
    """Return the distance [m], or minus the depth of contact where the distance is 0."""
    sampled, thing = sampler.sample(signal), _thing(signal)
    if thing not in obstacle_names(sampler.trace.scene):
        return sampled
    depth = sampler.sample(Signal("contact.depth", (Signal(thing),))).values
    values = np.where(sampled.values > 0.0, sampled.values, -depth + 0.0 * sampled.values)
    return SignalSeries(values, sampled.objects, sampled.names, sampled.note)


def _inside(signal: Signal, sampler: SignalSampler) -> SignalSeries:
    """Return the depth [m] of the robot's base in a place, negative outside."""
    sampled = sampler.sample(signal)
    border = Polygon(place_outline(sampler.trace.scene, _thing(signal))).exterior
    away = shapely.distance(shapely.points(sampler.poses[:, :2]), border)
    return SignalSeries(np.where(sampled.values > 0.0, away, -away), sampled.objects, sampled.names)


def _refine(near: SignalSeries, thing: str, sampler: SignalSampler) -> SignalSeries:
    """Return the clearance of the robot's outline instead of that of the box around it.

    Both are the same if the outline is a box; otherwise only near obstacles differ. The result
    grows with both, so that a nearer robot never has the larger value.
    """
    footprint = sampler.trace.spec.robot.footprint
    close = np.flatnonzero(near.values < _NEAR)
    if _is_box(footprint) or not len(close):
        return near
    obstacles = obstacles_named(sampler.obstacles, thing) if thing else sampler.obstacles
    values, objects = near.values.copy(), np.array(near.objects)
    # The outline is nowhere nearer than the box around it, so _NEAR limits it too.
    away, owner = nearest_polygons(obstacles, footprint, sampler.poses, close, reach=_NEAR)
    values[close], within = np.minimum(away, _NEAR), owner >= 0
    objects[close[within]] = owner[within]
    return SignalSeries(values, objects, near.names, near.note)


def _is_box(footprint: Ring) -> bool:
    """Return whether a footprint is the box around it."""
    _, (hx, hy) = footprint_box(footprint)
    return abs(Polygon(footprint).area - 4.0 * hx * hy) < 1e-9
