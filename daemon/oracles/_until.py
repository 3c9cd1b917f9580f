"""``always(...) until (...)``: what must hold before something that must come.

The margin is that of the predicate before the release, in the predicate's unit; a release that
never came has no amount in that unit, so it is missed by as little as a number can say.
"""

from __future__ import annotations

import math

import numpy as np

from daemon.oracles._finding import Finding, sentence, unknown
from daemon.oracles._operators import evidence_at
from daemon.oracles._predicate import JUST_BELOW, Truth, truth, unit_of_margin
from daemon.oracles._sampler import Sampler
from daemon.oracles._window import Mask, Window, scope_of, window_of
from daemon.verdict import Evidence
from grammars.oracle import Oracle, Until, render


def until(oracle: Oracle, judgement: Until, sampler: Sampler) -> Finding:
    """Judge ``always`` or ``never`` a predicate until another one holds.

    The release counts wherever it comes inside the window; the guard says where the predicate is
    judged. Violated before the release: fail, whatever comes.
    """
    timeline = sampler.timeline
    window, closed, awaited = _awaited(oracle, judgement, sampler)
    held = truth(judgement.predicate, sampler, negated=judgement.operator == "never")
    release = truth(judgement.release, sampler)
    scope = scope_of(oracle, sampler, window, held.margin)
    came = awaited & (release.margin >= 0.0)
    first = int(came.argmax()) if came.any() else len(came)
    before = scope.allowed & awaited & (np.arange(len(came)) < first)
    if not before.any():
        at_once = came.any() and scope.allowed.any()
        return unknown(f"vacuous: {_RELEASED}" if at_once else scope.reason)
    margin = np.where(before, held.margin, math.inf)
    index = int(margin.argmin())
    worst = float(margin[index])
    if not came.any() and closed and worst >= 0.0:
        return _never_came(judgement, release, sampler, awaited)
    ended = f"until {timeline.time[first]:.2f} s" if came.any() else window.cut
    evidence = evidence_at(held, timeline, index, scope.note, ended)
    if not unit_of_margin(judgement.predicate) and worst >= 0.0:
        # True or false, and nothing happened: no moment is more telling than another.
        evidence = Evidence(note=sentence(*held.notes, scope.note, ended))
    return Finding(worst if came.any() or closed else -math.inf, worst, evidence)


_RELEASED = "what it waits for held from the start"


def _awaited(oracle: Oracle, judgement: Until, sampler: Sampler) -> tuple[Window, bool, Mask]:
    """Return the window, whether the release can come no more, and where it would count."""
    window = window_of(oracle, sampler)
    if judgement.within is None:
        return window, window.closed, window.inside
    horizon = window.start + judgement.within.value
    awaited = window.inside & (sampler.timeline.time <= horizon + 1e-9)
    return window, window.closed or window.end >= horizon, awaited


def _never_came(judgement: Until, release: Truth, sampler: Sampler, awaited: Mask) -> Finding:
    """Fail, with the moment at which the release was nearest, if it can be near."""
    margin = JUST_BELOW if unit_of_margin(judgement.predicate) else -1.0
    note = f"{render(judgement.release)} never came"
    nearness = np.where(awaited & ~np.isnan(release.margin), release.margin, -math.inf)
    if not unit_of_margin(judgement.release) or np.isinf(nearness).all():
        return Finding(margin, margin, Evidence(note=note))
    evidence = evidence_at(release, sampler.timeline, int(nearness.argmax()), note)
    return Finding(margin, margin, evidence)
