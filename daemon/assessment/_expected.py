"""Expectations: which one is about a cell, and whether what came out is what was expected."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from fnmatch import fnmatchcase

from daemon.assessment._types import Expectation, Wanted
from daemon.verdict import Outcome


class Standing(Enum):
    """How a verdict stands to what is expected; ``open``: it may yet turn out either way."""

    MET = "met"
    OPEN = "open"
    CONTRADICTED = "contradicted"


def base_name(scenario: str) -> str:
    """Return the scenario's name in the file: ``S1`` for its variant ``S1@1003``."""
    return scenario.partition("@")[0]


def matches(expectation: Expectation, scenario: str, oracle: str, sut: str) -> bool:
    """Whether an expectation is about an oracle of a scenario with a system under test.

    A pattern that matches a scenario matches its variants.
    """
    names = (scenario, base_name(scenario))
    return (
        any(fnmatchcase(name, expectation.scenario) for name in names)
        and fnmatchcase(oracle, expectation.oracle)
        and any(fnmatchcase(sut, pattern) for pattern in expectation.suts or ("*",))
    )


def expected(
    expectations: Sequence[Expectation], scenario: str, oracle: str, sut: str
) -> tuple[Wanted, str]:
    """Return the verdict expected and why: that of the last expectation that matches, or pass."""
    for expectation in reversed(expectations):
        if matches(expectation, scenario, oracle, sut):
            return expectation.verdict, expectation.why
    return "pass", ""


def standing(wanted: Wanted, verdict: Outcome, *, passed: int, failed: int, n: int) -> Standing:
    """Compare what came out of ``n`` repeats with what was expected."""
    if wanted == "any":
        return Standing.MET
    if wanted == "pass":
        met, contradicted = verdict is Outcome.PASS, verdict is Outcome.FAIL
    elif wanted == "fail":
        met, contradicted = failed == n > 0, passed > 0
    else:
        met, contradicted = failed > 0, passed == n > 0
    if met:
        return Standing.MET
    return Standing.CONTRADICTED if contradicted else Standing.OPEN
