"""Records of runs that never ran, for tests of how they are judged together."""

from daemon.model.assessments import RunRecord
from daemon.model.spec import Timing
from daemon.model.verdicts import Evidence, Outcome, Verdict


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


def record(repeat, *verdicts, scenario="S1", sut="a2s", took=60.0, **other):
    """A run with a result."""
    found = [v.outcome for v in verdicts]
    worst = Outcome.FAIL if Outcome.FAIL in found else Outcome.PASS
    values = {
        "outcome": worst,
        "ended": "finished",
        "timing": Timing(1.0, 1.0, took),
        "seed": repeat,
    } | other
    name = f"c.{scenario}-{sut}-{repeat}"
    return RunRecord(name, scenario, sut, repeat, name, verdicts=verdicts, **values)


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
    return RunRecord(f"c.{repeat}", "S1", "a2s", repeat, "d", None, state=state)
