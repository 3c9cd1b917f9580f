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
from tests.engine.judging.test_verdicts import told as verdict_line
from tests.engine.judging.traces import along, answers, cut, make_trace, times, verdict

PAGE = Path(__file__).parents[3] / "docs" / "languages" / "oracles.md"
MODULE = """
import sys

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
quits = CustomOracle(lambda trace: sys.exit(1), "m")
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


def told(trace, text):
    """The verdict of an oracle, beside one that must not suffer, or why it is refused."""
    try:
        parse_oracle("it", text, Where("o.yaml", 1, 1))
    except InputError as refusal:
        (found,) = refusal.findings
        return f"refused: {found.message}" + f" ({found.hint})" * bool(found.hint)
    before = trace.ground_truth.x.copy()
    theirs, ours = judge(trace, (OracleText("it", text), OracleText("ours", "never(contact)")))
    assert ours.outcome in (Outcome.PASS, Outcome.INCONCLUSIVE)
    assert (trace.ground_truth.x == before).all()
    return verdict_line(theirs)


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_each_oracle_with_a_plug_in_comes_to_what_stands_below_it(golden, tmp_path):
    traces = {"whole": TRACE, "three seconds": cut(TRACE, 3.0)}
    found = answers(Path(__file__).with_name("plugins.txt"), traces.get, told)
    golden("plugins.txt", found.replace(f"{tmp_path}/", ""))


def test_the_numbers_of_a_plug_in_become_those_of_python():
    found = verdict(TRACE, "smooth(2 m/s^2)")
    assert (type(found.evidence.time), found.evidence.limit) == (float, 2.0)
