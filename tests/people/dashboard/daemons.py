"""Daemons with a campaign in which there is all an assessment can say, and with recorded runs."""

from dataclasses import replace

from daemon.batch.stores import file_sha256
from daemon.judging.oracles import judge
from daemon.model.assessments import (
    DELAY,
    AssessmentRules,
    Expectation,
    RepeatPolicy,
    ScenarioComparison,
)
from daemon.model.run_state import RunState
from daemon.model.spec import TraceInfo
from daemon.model.verdicts import Outcome
from daemon.trace import read_trace
from tests.people.fake import FakeDaemon, make_result, make_row, make_rows
from tests.people.recorded import record_run

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
FRESH = {"outcome": None, "oracle": "", "margin": None, "unit": "", "simulated": 0.0,
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
    changed[14] = FRESH | {"state": RunState.RUNNING}
    changed[17] = FRESH | {"state": RunState.LOST, "reason": "worker bench-1 went away"}
    return tuple(replace(row, **changed.get(row.index, {})) for row in rows)


def judged_campaign():
    return FakeDaemon(judged_rows(), declares=DECLARED)


def recorded_row(row, path, chosen=lambda _: True, **changes):
    """A finished run with its recording, judged by those of its oracles that are chosen."""
    trace = read_trace(path)
    verdicts = tuple(one for one in judge(trace, trace.spec.oracles) if chosen(one.oracle))
    info = TraceInfo(file_sha256(path), path.stat().st_size, 1)
    result = replace(make_result(row), verdicts=verdicts, trace=info, **changes)
    return replace(row, trace=str(path), result=result)


def recorded_daemon(path):
    """Runs 5 and 6 are the recorded one, with the verdicts it deserves."""
    note = "parameters without effect: a, b"
    return FakeDaemon(
        tuple(
            recorded_row(row, path, note=note) if row.index in (5, 6) else row
            for row in make_rows()
        )
    )


class RepeatingDaemon(FakeDaemon):
    """Run 5 is executed and judged again: other recordings at the same path."""

    def __init__(self, path):
        super().__init__()
        self._path = path
        self.execute()

    def _become(self, changed):
        self.rows = tuple(changed if row.index == 5 else row for row in self.rows)

    def execute(self, **changes):
        record_run(self._path, **changes)
        self._become(recorded_row(make_rows()[5], self._path))

    def judge_again(self):
        self._become(recorded_row(make_rows()[5], self._path, lambda oracle: oracle == "slow"))

    def become(self, state):
        row = make_rows()[5]
        self._become(replace(row, state=state, outcome=None, trace="", attempt=2))
