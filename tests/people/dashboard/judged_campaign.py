"""A campaign with everything an assessment can say, for the dashboard."""

from dataclasses import replace

from daemon.model.assessments import (
    DELAY,
    AssessmentRules,
    Expectation,
    RepeatPolicy,
    ScenarioComparison,
)
from daemon.model.run_state import RunState
from daemon.model.verdicts import Outcome
from tests.people.fake import FakeDaemon, make_row

DECLARED = AssessmentRules(
    RepeatPolicy(3, "all", 1.0, False, 3),
    (
        ScenarioComparison(
            "detour", DELAY, "S2", "S1", None, "<=", 30.0, "s", "delay(S2 vs S1) <= 30 s"
        ),
    ),
    (
        Expectation("S2", "no-contact", ("pilot",), "fail", "violated at the closed door"),
        Expectation("S3", "*", ("*",), "any", "nobody knows yet"),
    ),
)
_FAILING = {"outcome": Outcome.FAIL, "margin": -0.0312}
_FRESH = {"outcome": None, "oracle": "", "margin": None, "unit": "", "simulated": 0.0,
          "wall": 0.0, "trace": ""}  # fmt: skip


def judged_rows():
    """Two systems under test: an expected failure, a surprise, an open cell and a lost run."""
    cells = [(scenario, sut) for scenario in ("S1", "S2", "S3") for sut in ("pilot", "a2s")]
    rows = [
        make_row(3 * i + repeat, scenario=scenario, sut=sut, repeat=repeat)
        for i, (scenario, sut) in enumerate(cells)
        for repeat in range(3)
    ]
    changed = {6: _FAILING, 7: _FAILING, 8: _FAILING, 10: _FAILING}
    changed[14] = _FRESH | {"state": RunState.RUNNING}
    changed[17] = _FRESH | {"state": RunState.LOST, "reason": "worker bench-1 went away"}
    return tuple(replace(row, **changed.get(row.index, {})) for row in rows)


def judged_campaign():
    """A daemon with that campaign."""
    return FakeDaemon(judged_rows(), declares=DECLARED)
