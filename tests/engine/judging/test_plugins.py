"""Signals and oracles of other people: used when sound, explained when not, harmless always."""

import re
import sys
from pathlib import Path

import pytest

from daemon.judging.oracles import judge
from daemon.model.spec import OracleText
from daemon.model.verdicts import Outcome
from grammars.oracle import parse_oracle
from grammars.text.diagnostics import InputError, Where
from tests.engine.judging.traces import along, cut, make_trace, times, verdict

PAGE = Path(__file__).parents[3] / "docs" / "oracles.md"
MODULE = """
import numpy as np
from daemon.model.verdicts import Evidence
from grammars.oracle import CustomOracle, CustomSignal

def hold(trace, time, least):
    truth = trace.ground_truth
    return np.maximum(np.hypot(truth.vx, truth.vy)[: len(time)], least)

def vandal(trace, time):
    trace.ground_truth.x[:] = 0.0

def stops(trace, most):
    halts = float((trace.ground_truth.vx == 0.0).sum())
    return most - halts, most - halts, Evidence(1.0, halts, most, "floor", "counted")

pace = CustomSignal(hold, "m/s", "speed, at least this", ("m/s",))
busy = CustomSignal(lambda trace, time: time > 5.0, "bool")
short = CustomSignal(lambda trace, time: [1.0], "m")
words = CustomSignal(lambda trace, time: "fast", "m/s")
boundless = CustomSignal(lambda trace, time: time / 0.0 if len(time) else time, "s")
broken = CustomSignal(lambda trace, time: trace.no_such_thing, "m")
vandal = CustomSignal(vandal, "m")
inches = CustomSignal(hold, "cm")
unmade = CustomSignal(hold, "parsec")
listed = CustomSignal(hold, "m/s", arguments=["m/s"])
switched = CustomSignal(hold, "m/s", arguments=("bool",))
idle = CustomSignal(None, "m/s")
odd = CustomOracle(stops, "1", arguments=("1", "cm"))
halts = CustomOracle(stops, "1", arguments=("1",))
vague = CustomOracle(lambda trace: (1.0, 1.0, Evidence(float("nan"))), "m")
sure = CustomOracle(lambda trace: (0.5, 0.5), "m", judges_prefixes=True)
upside = CustomOracle(lambda trace: (1.0, 0.0), "m")
nothing = CustomOracle(lambda trace: None, "m")
quits = CustomOracle(lambda trace: exit(1), "m")
number = 42
"""
NAMED = re.findall(r"^(\w+) = Custom(Signal|Oracle)", MODULE, re.MULTILINE)


@pytest.fixture(autouse=True)
def plugged(tmp_path, monkeypatch, plug_oracles):
    (tmp_path / "their_oracles.py").write_text(MODULE)
    (tmp_path / "their_imports.py").write_text("import a_module_nobody_has\n")
    (example,) = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    (tmp_path / "their_documentation.py").write_text(example)
    monkeypatch.syspath_prepend(str(tmp_path))
    signals, oracles = (
        {name: f"their_oracles:{name}" for name, what in NAMED if what == kind}
        for kind in ("Signal", "Oracle")
    )
    signals |= {
        "my.pace": "their_oracles:pace",
        "speed": "their_oracles:busy",
        "stop.distance": "their_documentation:stop_distance",
        "imports": "their_imports:signal",
        "number": "their_oracles:number",
    }
    oracles["smooth"] = "their_documentation:smooth"
    plug_oracles(signals, oracles)
    yield
    for name in ("their_oracles", "their_imports", "their_documentation"):
        sys.modules.pop(name, None)


TRACE = make_trace(along(times(10.0)))


def refusal(text):
    with pytest.raises(InputError) as caught:
        parse_oracle("it", text, Where("o.yaml", 1, 1))
    (found,) = caught.value.findings
    return found


def test_a_signal_of_ones_own_is_used_like_any_other():
    found = verdict(TRACE, "max(my.pace(0.7 m/s)) <= 1 m/s")
    assert (found.outcome, found.unit) == (Outcome.PASS, "m/s")
    assert found.margin == pytest.approx(0.3)
    assert verdict(TRACE, "time(busy) <= 4 s").outcome is Outcome.FAIL
    assert verdict(cut(TRACE, 3.0), "eventually(busy)").outcome is Outcome.INCONCLUSIVE


def test_the_example_of_the_documentation_works():
    found = verdict(TRACE, "always(stop.distance(0.5 m/s^2) < clearance)")
    assert (found.outcome, found.unit, found.evidence.value) == (Outcome.PASS, "m", 0.25)
    found = verdict(TRACE, "smooth(2 m/s^2)")
    assert (found.outcome, found.margin) == (Outcome.PASS, pytest.approx(2.0))
    assert (type(found.evidence.time), found.evidence.limit) == (float, 2.0)


def test_what_ships_here_is_never_replaced():
    assert verdict(TRACE, "max(speed)").evidence.value == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("max(pace)", "pace takes 1 arguments, 0 given"),
        ("max(pace(1 m))", 'pace takes m/s, but "1 m" is in m'),
        ("max(busy)", "true or false"),
        ("max(imports)", "cannot be loaded: ModuleNotFoundError"),
        ("max(number)", "must be a grammars.oracle.CustomSignal, not int"),
        ("max(inches)", "declares 'cm': \"cm\" is not an SI unit"),
        ("max(unmade)", "declares 'parsec'"),
        ("max(listed)", "must declare its arguments as a tuple of units"),
        ("max(switched)", "must declare its arguments as a tuple of units"),
        ("max(idle)", 'the signal "idle" has no function to call'),
        ("odd(1, 1)", "declares 'cm': \"cm\" is not an SI unit"),
        ("halts()", "halts takes 1 arguments, 0 given"),
        ("halts(1 m)", 'halts takes 1, but "1 m" is in m'),
        ("sure() when contact", "judges the whole run"),
        ("sure() on leg 1", "judges the whole run"),
    ],
)
def test_misuse_is_found_before_any_run(text, message):
    assert message in refusal(text).message


@pytest.mark.parametrize(("text", "hint"), [("max(my.pase)", "my.pace"), ("halt(1)", "halts")])
def test_names_of_plug_ins_are_suggested(text, hint):
    assert f'"{hint}"' in refusal(text).hint


def test_an_oracle_of_ones_own_gives_an_interval_and_evidence():
    found = verdict(TRACE, "halts(3)")
    assert (found.outcome, found.lower, found.upper, found.unit) == (Outcome.PASS, 3.0, 3.0, "1")
    assert (found.evidence.object, found.evidence.note) == ("floor", "counted")


def test_an_oracle_that_does_not_know_of_prefixes_decides_no_run_that_goes_on():
    assert verdict(cut(TRACE, 5.0), "halts(3)").outcome is Outcome.INCONCLUSIVE
    assert verdict(cut(TRACE, 5.0), "sure()").outcome is Outcome.PASS


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("max(short)", r"shape (1,) for 201 times"),
        ("max(words)", "gave no numbers"),
        ("max(boundless)", "infinite"),
        ("max(broken)", "failed: AttributeError"),
        ("max(vandal)", "read-only"),
        ("upside()", "gave the interval [1.0, 0.0]"),
        ("vague()", "evidence that is not finite"),
        ("nothing()", "must return (lower, upper)"),
        ("quits()", "failed: SystemExit"),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_what_fails_is_an_error_of_that_oracle_alone(text, message):
    before = TRACE.ground_truth.x.copy()
    written = (OracleText("theirs", text), OracleText("ours", "never(contact)"))
    theirs, ours = judge(TRACE, written)
    assert theirs.outcome is Outcome.ERROR
    assert message in theirs.evidence.note
    assert ours.outcome is Outcome.PASS
    assert (TRACE.ground_truth.x == before).all()
