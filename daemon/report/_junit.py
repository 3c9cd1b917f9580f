"""JUnit XML: a suite for each cell, a case for each of its oracles, as build servers read them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from daemon.assessment import Cell, ComparisonCell, OracleCell, told
from daemon.report._extra import needed
from daemon.report._gather import Material
from daemon.report._words import quantity
from daemon.verdict import Outcome
from templates.naming import xml_text


def write_junit(material: Material, path: Path) -> None:
    """Write what :func:`daemon.assessment.assess` made of the campaign.

    FAIL is a failure, ERROR an error, INCONCLUSIVE an error of type ``inconclusive``; what fails
    as expected is skipped (``xfail: why``), what passes against expectation a failure of type
    ``xpass``. Raises :class:`InputError` without the extra ``report``.
    """
    junit = needed("junitparser", "a JUnit file")
    xml = junit.JUnitXml(xml_text(material.chosen.name))
    wall = {run.record.id: run.record.timing.wall for run in material.runs if run.record.timing}
    for cell in material.assessment.cells:
        suite = junit.TestSuite(xml_text(f"{cell.scenario}/{cell.sut}"))
        for case in _cases(cell, material, junit):
            suite.add_testcase(case)
        suite.update_statistics()
        suite.time = round(sum(wall.get(run, 0.0) for run in cell.runs), 3)
        xml.add_testsuite(suite)
    if material.assessment.comparisons:
        suite = junit.TestSuite("comparisons")
        for comparison in material.assessment.comparisons:
            suite.add_testcase(_comparison(comparison, material, junit))
        suite.update_statistics()
        xml.add_testsuite(suite)
    xml.update_statistics()
    xml.write(str(path), pretty=True)


def _cases(cell: Cell, material: Material, junit: Any) -> list[Any]:
    place = f"{material.chosen.name}.{cell.scenario}.{cell.sut}"
    if not cell.oracles:
        case = junit.TestCase("runs", xml_text(place))
        case.result = [junit.Error("no run was judged by any oracle", str(cell.verdict))]
        return [case]
    return [_case(oracle, place, material, junit) for oracle in cell.oracles]


def _case(oracle: OracleCell, place: str, material: Material, junit: Any) -> Any:
    case = junit.TestCase(xml_text(oracle.oracle), xml_text(place))
    case.result = _result(oracle, oracle.passed > 0, _said(oracle), junit)
    lines = [
        f"{run.record.id}: {verdict.outcome}  {told(verdict)}"
        for run in material.runs
        if (run.record.scenario, run.record.sut) == (oracle.scenario, oracle.sut)
        and (verdict := run.record.verdict(oracle.oracle)) is not None
    ]
    case.system_out = xml_text("\n".join(lines))
    return case


def _said(oracle: OracleCell) -> str:
    parts = [f"{oracle.passed} of {oracle.n} pass"]
    if oracle.worst is not None:
        parts.append(f"worst in {oracle.worst.run}: {told(oracle.worst.verdict)}")
        parts.append(oracle.worst.verdict.text)
    return "; ".join(parts)


def _comparison(cell: ComparisonCell, material: Material, junit: Any) -> Any:
    case = junit.TestCase(
        xml_text(f"{cell.comparison} {cell.sut}"), xml_text(f"{material.chosen.name}.comparisons")
    )
    said = f"mean {quantity(cell.mean, cell.unit, signed=True)}, n={cell.n}: {cell.text}"
    passed = cell.verdict is Outcome.PASS
    case.result = _result(cell, passed, f"{said}; {cell.note}".removesuffix("; "), junit)
    return case


def _result(cell: OracleCell | ComparisonCell, passed: bool, said: str, junit: Any) -> list[Any]:
    message = xml_text(said)
    if cell.expected != "pass" and cell.met:
        if cell.verdict is Outcome.PASS:
            return []
        return [junit.Skipped(xml_text(f"xfail: {cell.why}"), "xfail")]
    if cell.verdict is Outcome.ERROR:
        return [junit.Error(message, "error")]
    if cell.expected != "pass" and passed:
        text = f"expected {cell.expected} ({cell.why}), but {said}"
        return [junit.Failure(xml_text(text), "xpass")]
    if cell.verdict is Outcome.INCONCLUSIVE:
        return [junit.Error(message, "inconclusive")]
    return [junit.Failure(message, "fail")] if cell.verdict is Outcome.FAIL else []
