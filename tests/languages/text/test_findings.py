"""Findings: errors and warnings that readers and checkers gather before they raise."""

from __future__ import annotations

import pytest

from grammars.text.diagnostics import Findings, InputError, Where

FILE = "a.scenery"


def test_all_errors_and_warnings_are_raised_in_source_order() -> None:
    findings = Findings()
    findings.error(Where(FILE, 7), "late")
    findings.warning(Where(FILE, 3), "odd")
    findings.error(Where(FILE, 1), "early", "mend it")
    with pytest.raises(InputError) as caught:
        findings.raise_errors()
    assert [d.message for d in caught.value.findings] == ["early", "odd", "late"]


def test_warnings_alone_raise_nothing() -> None:
    findings = Findings()
    findings.warning(Where(FILE, 3), "odd")
    findings.raise_errors()
    assert [d.message for d in findings.warnings] == ["odd"]
    assert findings.errors == ()


def test_an_input_error_ends_its_block_and_is_collected() -> None:
    findings = Findings()
    for line in (2, 1):
        with findings.collecting():
            raise InputError.at(Where(FILE, line), f"wrong in line {line}")
    assert [d.where.line for d in findings.errors] == [1, 2]


def test_files_keep_the_order_in_which_they_appear() -> None:
    findings = Findings()
    for file, line in (("b", 5), ("a", 1), ("b", 2)):
        findings.error(Where(file, line), "wrong")
    assert [(d.where.file, d.where.line) for d in findings.errors] == [("b", 2), ("b", 5), ("a", 1)]


def test_the_same_error_is_raised_once() -> None:
    findings = Findings()
    findings.error(Where(FILE, 1), "wrong")
    findings.error(Where(FILE, 1), "wrong")
    with pytest.raises(InputError) as caught:
        findings.raise_errors()
    assert len(caught.value.findings) == 1
