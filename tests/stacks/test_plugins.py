"""Systems under test that plug in: loaded by entry point, held to the protocol."""

import os
import sys
from importlib.metadata import EntryPoint

import pytest

from daemon.stacks import registry
from daemon.stacks.findings import ParameterFindings
from daemon.stacks.registry import check_parameters, make_sut
from tests.plugins import MODULE, install_plugins, let_time_pass_while, place_of

STACK = """
class Stack:
    period = 0.05
    needs_ground_truth = False

    def __init__(self, parameters):
        unknown = sorted(set(parameters) - {"speed", "period"})
        if unknown:
            raise ValueError(f'no parameter "{unknown[0]}"')
        self.period = parameters.get("period", 0.05)

    def start(self, briefing):
        pass

    def update(self, observation):
        pass

def broken(parameters):
    raise KeyError("weights")

def number(parameters):
    return 42
"""


@pytest.fixture
def plugged(tmp_path, monkeypatch):
    (tmp_path / "their_stack.py").write_text(STACK)
    (tmp_path / "their_imports.py").write_text("import a_module_nobody_has\n")
    (tmp_path / "their_syntax.py").write_text("def make(:\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    places = {name: f"their_stack:{name}" for name in ("broken", "number", "gone")}
    places |= {"stack": "their_stack:Stack", "imports": "their_imports:make"}
    places["syntax"] = "their_syntax:make"
    group = registry.ENTRY_POINT_GROUP
    entries = {name: EntryPoint(name, value, group) for name, value in places.items()}
    monkeypatch.setattr(registry, "installed", lambda group: entries)
    yield
    for name in ("their_stack", "their_imports", "their_syntax"):
        sys.modules.pop(name, None)


def test_a_stack_of_ones_own_is_made_with_its_parameters(plugged):
    assert make_sut("stack", {"speed": 1.0}).period == 0.05
    with pytest.raises(ValueError, match='no parameter "sped"'):
        make_sut("stack", {"sped": 1.0})


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("imports", r"cannot be loaded: ModuleNotFoundError.*\(.*their_imports.py:1\)"),
        ("syntax", "cannot be loaded: SyntaxError"),
        ("gone", "cannot be loaded: AttributeError"),
        ("broken", r"cannot be made: KeyError: 'weights' \(.*their_stack.py:"),
        ("number", r"has no method start\(\)"),
        ("stak", 'no system under test of kind "stak": did you mean "stack"?'),
    ],
)
def test_a_stack_that_cannot_be_had_is_explained(plugged, kind, words):
    with pytest.raises(ValueError, match=words):
        make_sut(kind, {})


@pytest.mark.parametrize("period", [0, 0.0, -0.1, 0.033, float("nan"), float("inf"), "0.1", True])
def test_a_period_is_a_positive_multiple_of_a_tick(plugged, period):
    with pytest.raises(ValueError, match="period"):
        make_sut("stack", {"period": period})


def test_the_step_of_the_simulation_is_said_once(plugged, monkeypatch):
    monkeypatch.setattr(registry, "TICK_RATE", 50)
    with pytest.raises(ValueError, match=r"0\.01 s, not a multiple of 0\.02 s"):
        make_sut("stack", {"period": 0.01})


@pytest.fixture
def installed(tmp_path, monkeypatch):
    install_plugins(tmp_path, monkeypatch)
    yield
    sys.modules.pop(MODULE, None)


def test_a_check_makes_a_stack_without_another_process(installed, monkeypatch):
    # A child forked beside threads may wait for ever for a lock that one of them held.
    monkeypatch.setattr(os, "fork", lambda: pytest.fail("forked"))
    assert check_parameters("plain", {}) == ParameterFindings()


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("factory-leaves", "cannot be made: SystemExit: 2"),
        ("factory-refuses", '^"speed" must be positive$'),
        ("factory-reads-with-a-library", "^speed must be a number"),
        ("factory-has-no-words", "ValueError without a message"),
    ],
)
def test_a_check_says_what_a_factory_refuses(installed, kind, words):
    with pytest.raises(ValueError, match=words):
        check_parameters(kind, {})


@pytest.mark.parametrize(
    ("kind", "place"), [("factory-hangs", "hangs"), ("import-hangs", "<module>")]
)
def test_a_check_says_where_a_factory_hangs(installed, monkeypatch, kind, place):
    let_time_pass_while(monkeypatch, lambda frame: frame.f_code.co_name == place)
    monkeypatch.setattr(registry, "CHECK_LIMIT", 0.1)
    words = r"was not made: stopped after 0.1 s .* its factory \(.*\.py:\d+\); longer work"
    with pytest.raises(ValueError, match=words) as caught:
        check_parameters(kind, {})
    if kind == "factory-hangs":
        line = int(place_of("its factory hangs").rpartition(":")[2])
        assert any(f"{MODULE}.py:{number})" in str(caught.value) for number in (line - 1, line))
