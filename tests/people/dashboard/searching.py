"""A search along the corridor for the dashboard: sixty runs, two ways to fail."""

from dataclasses import replace
from functools import cache

import numpy as np

from daemon.model.search import OracleScale, Proposal, SearchParameter
from daemon.model.search_answer import (
    DistinctFailure,
    Influence,
    NearestFailure,
    SearchAnswer,
    SearchRow,
)
from daemon.model.spec import LeadingMargin
from daemon.model.trials import read_trial
from daemon.model.verdicts import Outcome, RunState
from tests.make import FRESH
from tests.people import fake_search
from tests.people.fake import NOW, FakeDaemon, make_result, make_row

SEARCH = fake_search.SEARCH
_HALTON = 16
_RANGES = (
    ("doors_moving.bedroom_opens", "s", 2.1, 3.9, 3.0, 0.01),
    ("doors_moving.bedroom_closes", "s", 5.1, 6.9, 6.0, 0.01),
    ("doors_moving.kitchen_opens", "s", 7.1, 8.9, 8.0, 0.01),
    ("doors_moving.kitchen_closes", "s", 11.1, 12.9, 12.0, 0.01),
    ("doors_moving.swing", "deg/s", 48.0, 72.0, 60.0, 0.1),
    ("mission.start.y", "m", -0.2, 0.2, 0.0, 0.001),
)
_ROBOT_AND_CHOICE = fake_search.TASK.parameters[1:]
TASK = replace(
    fake_search.TASK,
    minimise="no-contact",
    scales=(OracleScale("no-contact", 0.25, "m"),),
    parameters=(
        *(
            SearchParameter(
                name, "behaviours", 0, name.partition(".")[2], unit, low, high, step,
                written=written,
            )
            for name, unit, low, high, written, step in _RANGES
        ),
        *_ROBOT_AND_CHOICE,
    ),
)  # fmt: skip
WRITTEN = tuple(one.written for one in TASK.parameters if one.written is not None)


@cache
def make_proposals(count=60, *, settled=None):
    """Proposals of a search, the first ``settled`` of them with a result.

    The space-filling ones find a shallow failure, the guided ones deeper and deeper ones.
    """
    draws = np.random.default_rng(5)
    rows = []
    for index in range(count):
        drawn = draws.random(len(TASK.parameters))
        dip = max(0.0, index - _HALTON) / 44.0
        margin = 0.105 - 0.12 * float(drawn[0]) ** 2 - 0.07 * dip * float(drawn[1])
        values = tuple(_value(one, float(u)) for one, u in zip(TASK.parameters, drawn, strict=True))
        if index == 0:
            margin, values = 0.105, WRITTEN
        done = settled is None or index < settled
        margin_or_none = None if index == 23 else round(margin, 4)
        rows.append(proposal_row(index, values, margin_or_none, done=done))
    return tuple(rows)


def _value(parameter, share):
    if parameter.choices:
        return parameter.choices[int(share * len(parameter.choices))]
    value = parameter.low + share * (parameter.high - parameter.low)
    return round(round(value / parameter.step) * parameter.step, 6)


def proposal_row(position, values, margin, *, done=True, phase="explore"):
    """A run of the search; without a margin it is inconclusive."""
    method = "written" if position == 0 else "halton" if position < _HALTON else "tpe"
    proposal = Proposal(position, position, 0, phase, method, position >= _HALTON, tuple(values))
    row = make_row(
        position, id=f"{SEARCH}.{position}", campaign=SEARCH, scenario=f"doors-in-time.{position}",
        repeat=0, margin=margin, trace="", digest=f"{position:064d}", proposal=proposal,
    )  # fmt: skip
    if not done:
        return replace(row, state=RunState.RUNNING, **FRESH)
    object = "door-1" if position % 2 else "hall-wall-1"
    row = replace(row, outcome=Outcome.INCONCLUSIVE if margin is None else _outcome(margin))
    lead = LeadingMargin("no-contact", margin, "m", object)
    return replace(row, result=replace(make_result(row), leads=(lead,)))


def _outcome(margin):
    return Outcome.FAIL if margin < 0.0 else Outcome.PASS


NEAREST = proposal_row(
    60, (3.0, 6.0, 8.54, 12.0, 60.0, 0.0, 0.01, "bedroom_door"), -0.018, phase="nearest"
)


def make_answer(rows, *, ended="budget"):
    """What such a search says when it is over."""
    rows = [row for row in rows if row.proposal.phase == "explore"]
    known = [row for row in rows if row.leads and row.leads[0].margin is not None]
    points = [read_trial(TASK, row) for row in known]
    failed = [point for point in points if point.fails]
    best = min(points, key=lambda point: point.value.value if point.value else 0.0)
    nearest = NearestFailure(read_trial(TASK, NEAREST), None, 13, complete=True)
    first = failed[0]
    objects = sorted({point.value.object for point in failed if point.value})
    groups = {name: [p for p in failed if p.value and p.value.object == name] for name in objects}
    return SearchAnswer(
        ended, len(rows), len(rows), 0, len(failed), 0, 1, _HALTON, 1,
        first=first, best=best, nearest=nearest,
        findings=tuple(
            DistinctFailure("no-contact", name, "w2", len(group), group[-1])
            for name, group in groups.items()
        ),
        influence=(
            Influence("doors_moving.bedroom_opens", -0.81, _HALTON),
            Influence("doors_moving.swing", 0.12, _HALTON),
        ),
        sentences=(
            "no-contact fails with kitchen_opens 8.54 s instead of 8 s (margin −0.018 m)",
            f"{len(failed)} of 60 runs fail, the first is run {first.number}",
            "1 of 16 space-filling runs fails.",
        ),
    )  # fmt: skip


def make_search(rows, state="finished", **changes):
    """The search of these runs."""
    row = SearchRow(
        SEARCH, "house", NOW - 100.0, TASK, state,
        proposed=len(rows), finished=sum(row.settled for row in rows),
        answer=make_answer(rows) if state == "finished" else None,
    )  # fmt: skip
    return replace(row, **changes)


class SearchingDaemon(FakeDaemon):
    """A daemon with a search."""

    @classmethod
    def finished(cls, **changes):
        rows = (*make_proposals(), NEAREST)
        return cls(found=(make_search(rows),), proposed=rows, **changes)

    @classmethod
    def running(cls, settled=38):
        rows = make_proposals(settled + 4, settled=settled)
        return cls(found=(make_search(rows, "running"),), proposed=rows)

    def go_on(self, settled):
        """Have more runs of the search be over."""
        self.proposed = make_proposals(min(settled + 4, 60), settled=settled)
        (before,) = self.found
        counts = {"proposed": len(self.proposed), "finished": settled}
        self.found = (replace(before, **counts),)
