"""Records of runs that never ran, for tests of how they are judged together."""

from daemon.model.verdicts import Evidence, Outcome, RunState, Verdict
from tests.make import run_result, run_row


def verdict(margin, oracle="clear", text="always(...)"):
    """A verdict by its margin [m]; without one it is inconclusive."""
    if margin is None:
        return Verdict(oracle, text, Outcome.INCONCLUSIVE, None, None, "m")
    outcome = Outcome.PASS if margin >= 0 else Outcome.FAIL
    seen = Evidence(time=41.3, value=margin, object="door-17")
    return Verdict(oracle, text, outcome, margin, margin, "m", seen)


def measure(value, name="buffer-time", unit="s"):
    """What a measure found."""
    seen = Evidence(value=value)
    return Verdict(name, "time(...)", Outcome.MEASURE, None, None, unit, seen)


def record(
    repeat, *verdicts, scenario="S1", sut="a2s", took=60.0, ended="finished", note="",
    outcome=None, **other,
):  # fmt: skip
    """A run with a result."""
    found = [v.outcome for v in verdicts]
    worst = outcome or (Outcome.FAIL if Outcome.FAIL in found else Outcome.PASS)
    result = run_result(*verdicts, outcome=worst, ended=ended, simulated=took, note=note)
    name = f"c.{scenario}-{sut}-{repeat}"
    values = {"seed": repeat, "digest": name} | other
    return run_row(name, scenario, sut, repeat, result, **values)


def cell(margins, **other):
    """Repeats of one cell by the margins of their only oracle."""
    return tuple(record(i, verdict(margin), **other) for i, margin in enumerate(margins))


def timed(scenario, times, **other):
    """Repeats of one scenario by the time each took [s]."""
    return tuple(
        record(i, verdict(1.0), scenario=scenario, took=took, **other)
        for i, took in enumerate(times)
    )


def lost(repeat, state="lost"):
    """A run without a result."""
    return run_row(f"c.{repeat}", "S1", "a2s", repeat, state=RunState(state))
