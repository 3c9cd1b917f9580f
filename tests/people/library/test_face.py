"""The public interface: its names, its signatures, its errors."""

import ast
import inspect
import operator
import re
from pathlib import Path

import pytest

import scenario_tui
from scenario_tui import errors

SIGNATURES = Path(__file__).with_name("signatures.txt")
EVERYTHING = Path(__file__).with_name("everything.py")


def test_the_public_names_are_all_there_is():
    assert dir(scenario_tui) == sorted(scenario_tui.__all__)
    assert len(scenario_tui.__all__) <= 20
    for name in scenario_tui.__all__:
        assert getattr(scenario_tui, name).__doc__, name
    with pytest.raises(AttributeError, match="claim_nothing"):
        scenario_tui.claim_nothing  # noqa: B018


def test_signatures_stay_and_a_script_that_type_checkers_read_uses_every_name(golden):
    names = [line.partition("(")[0] for line in SIGNATURES.read_text("utf-8").splitlines()]
    lines = []
    for name in names:
        found = inspect.signature(operator.attrgetter(name)(scenario_tui))
        lines.append(f"{name}{found.replace(return_annotation=inspect.Signature.empty)}\n")
    golden(SIGNATURES.name, "".join(lines))
    tree = ast.parse(EVERYTHING.read_text(encoding="utf-8"))
    used = {n.attr for n in ast.walk(tree) if isinstance(n, ast.Attribute)}
    assert {*scenario_tui.__all__, *(name.rpartition(".")[2] for name in names)} <= used


def test_the_tree_of_errors_is_drawn_as_it_is():
    drawn = {}
    above = []
    for line in (errors.__doc__ or "").splitlines():
        found = re.match(r"([│ ]*(?:[├└]── )?)([A-Z]\w+)  ", line)
        if found:
            depth = len(found[1]) // 4
            above[depth:] = [found[2]]
            drawn[found[2]] = above[depth - 1] if depth else "Exception"
    assert set(drawn) == set(errors.__all__)
    for name, parent in drawn.items():
        assert getattr(errors, name).__bases__[0].__name__ == parent, name
