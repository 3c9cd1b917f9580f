"""Systems under test that plug in: loaded by entry point, held to the protocol."""

import sys
from importlib.metadata import EntryPoint

import pytest

from daemon.stacks import registry
from daemon.stacks.registry import make_sut

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
    objects = {
        "stack": "their_stack:Stack",
        "broken": "their_stack:broken",
        "number": "their_stack:number",
        "gone": "their_stack:gone",
        "imports": "their_imports:make",
        "syntax": "their_syntax:make",
    }
    group = registry.ENTRY_POINT_GROUP
    known = [EntryPoint(name, value, group) for name, value in objects.items()]

    def entry_points(**wanted):
        return [entry for entry in known if entry.matches(**wanted)]

    monkeypatch.setattr(registry, "entry_points", entry_points)
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
