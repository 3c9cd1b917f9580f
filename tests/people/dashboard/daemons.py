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
from daemon.model.spec import TraceInfo
from daemon.model.verdicts import Outcome, RunState
from daemon.trace import read_trace
from tests.make import FRESH
from tests.people.fake import FakeDaemon, make_row
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


class RecordedDaemon(FakeDaemon):
    """Runs 5 and 6 are the recorded one, with the verdicts it deserves."""

    indices = (5, 6)
    """Those of the recorded runs."""

    def __init__(self, trace):
        super().__init__()
        self.change(trace=str(trace))
        recorded = read_trace(trace)
        self.result = {"verdicts": judge(recorded, recorded.spec.oracles)}

    def change(self, **changes):
        """Have the rows of the recorded runs be others."""
        self.rows = tuple(
            replace(row, **changes) if row.index in self.indices else row for row in self.rows
        )

    def run(self, run):
        detail = super().run(run)
        if detail.row.index not in self.indices or detail.row.result is None:
            return detail
        note = "parameters without effect: a, b"
        result = replace(detail.row.result, **{"note": note} | self.result)
        return replace(detail, row=replace(detail.row, result=result))


class RepeatingDaemon(RecordedDaemon):
    """Run 5 is executed and judged again: other recordings at the same path."""

    indices = (5,)

    def __init__(self, path):
        super().__init__(record_run(path))
        self._path, self._first = path, self.rows
        self.execute()

    def execute(self, **changes):
        recorded = read_trace(record_run(self._path, **changes))
        info = TraceInfo(file_sha256(self._path), self._path.stat().st_size, 1)
        verdicts = judge(recorded, recorded.spec.oracles)
        self.result = {"verdicts": verdicts, "trace": info, "note": ""}
        self.rows = self._first

    def judge_again(self):
        verdicts = tuple(v for v in self.result["verdicts"] if v.oracle == "slow")
        self.result |= {"verdicts": verdicts}

    def become(self, state):
        self.change(state=state, outcome=None, trace="", attempt=2)
