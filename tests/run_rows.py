"""Rows of runs that never ran, with results."""

from dataclasses import replace

from daemon.model.run_state import RunState
from daemon.model.spec import RunResult, Timing, TraceInfo
from daemon.model.status import RunRow
from daemon.model.verdicts import combine


def run_result(
    *verdicts, outcome=None, ended="finished", wall=0.5, cpu=0.5, simulated=60.0, **more
):
    """What a run with these verdicts leaves."""
    return RunResult(
        "0" * 64, outcome or combine(verdicts), verdicts, ended, TraceInfo("1" * 64, 1000, 10),
        Timing(0.5, cpu, simulated), **more,
    )  # fmt: skip


def run_row(id="c.0", scenario="S1", sut="pilot", repeat=0, result=None, **more):
    """A run of a campaign; one with a result is done."""
    campaign, _, index = id.rpartition(".")
    values = {"state": RunState.QUEUED if result is None else RunState.DONE, "limit": 1200.0}
    if result is not None:
        values |= {"outcome": result.outcome, "simulated": result.timing.simulated}
        values |= {"wall": result.timing.wall, "attempt": 1}
    values = {"attempt": 0, "worker": "", "outcome": None, "oracle": "", "margin": None,
              "unit": "", "simulated": 0.0, "wall": 0.0, "trace": ""} | values | more  # fmt: skip
    number = int(index) if index.isdecimal() else 0
    return RunRow(id, campaign, number, scenario, sut, repeat, result=result, **values)


def with_result(row, **changes):
    """The same run with another result."""
    return replace(row, result=replace(row.result, **changes))
