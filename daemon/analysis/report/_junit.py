"""JUnit XML, which build servers read: a suite for each cell, a case for each of its oracles.

Written as the schema of Jenkins' xUnit plug-in (``junit-10.xsd``) has it; what GitLab and actions
of GitHub read is part of that.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from daemon.analysis.report._formatting import format_quantity
from daemon.judging.assessment import evidence_text
from daemon.model.assessments import (
    Assessment,
    CellAssessment,
    CellVerdict,
    ComparisonVerdict,
    ExpectationStatus,
)
from daemon.model.status import RunRow
from daemon.model.verdicts import Outcome
from grammars.text.files import write_atomically
from templates.naming import xml_text


@dataclass(frozen=True, slots=True)
class _CaseResult:
    """What stands in a case that is no plain pass: the element's name, its type and message."""

    element: str
    type: str
    message: str


@dataclass(frozen=True, slots=True)
class _Case:
    name: str
    place: str
    result: _CaseResult | None
    output: str = ""


def write_junit(name: str, assessment: Assessment, records: Sequence[RunRow], path: Path) -> None:
    """Write what :func:`daemon.judging.assessment.assess` made of the runs of a campaign.

    FAIL is a failure, ERROR an error, INCONCLUSIVE an error of type ``inconclusive``, or of that of
    the state of the runs that are missing (``queued``, ``lost`` ...); what fails
    as expected is skipped (``xfail: why``), what passes against expectation a failure of type
    ``xpass``.

    The time of a suite is the wall clock [s] its runs took, where only traces are left the time
    they simulated; a property says which. One run serves every oracle, so each case has an equal
    share of it. Raises ``OSError`` when the file cannot be written.
    """
    runs = {record.id: record for record in records}
    suites = [_cell_suite(name, cell, runs) for cell in assessment.cells]
    if assessment.comparisons:
        cases = [_comparison_case(name, comparison) for comparison in assessment.comparisons]
        suites.append(_suite("comparisons", cases, 0.0, {}))
    root = ElementTree.Element("testsuites", name=xml_text(name))
    root.extend(suites)
    for key in ("tests", "failures", "errors"):
        root.set(key, str(sum(int(suite.get(key, "0")) for suite in suites)))
    root.set("time", f"{sum(float(suite.get('time', '0')) for suite in suites):.3f}")
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, text + b"\n")


def _cell_suite(
    campaign: str, cell: CellAssessment, runs: Mapping[str, RunRow]
) -> ElementTree.Element:
    place = f"{campaign}.{cell.scenario}.{cell.sut}"
    records = [runs[run] for run in cell.runs if run in runs]
    cases = [_oracle_case(oracle, place, records) for oracle in cell.oracles]
    if not cases:
        message = "no run was judged by any oracle"
        if cell.state != "done":
            message = f"no run has a result: {cell.state}"
        cases = [_Case("runs", place, _CaseResult("error", cell.word, message))]
    seconds, clock = _time(records)
    about = {"runs": str(len(cell.runs)), "time": clock}
    return _suite(f"{cell.scenario}/{cell.sut}", cases, seconds, about)


def _time(records: Iterable[RunRow]) -> tuple[float, str]:
    """Return the seconds of runs and which clock they are of."""
    known = [record.result.timing for record in records if record.result is not None]
    wall = sum(timing.wall for timing in known)
    # Traces say what they simulated, not what that took.
    if wall > 0.0:
        return wall, "wall clock"
    return sum(timing.simulated for timing in known), "simulated"


def _suite(
    name: str, cases: Sequence[_Case], seconds: float, about: Mapping[str, str]
) -> ElementTree.Element:
    results = [case.result.element for case in cases if case.result is not None]
    suite = ElementTree.Element(
        "testsuite",
        name=xml_text(name),
        tests=str(len(cases)),
        failures=str(results.count("failure")),
        errors=str(results.count("error")),
        skipped=str(results.count("skipped")),
        time=f"{seconds:.3f}",
    )
    if about:
        properties = ElementTree.SubElement(suite, "properties")
        for key, value in about.items():
            ElementTree.SubElement(properties, "property", name=key, value=xml_text(value))
    for case in cases:
        suite.append(_case_element(case, seconds / len(cases)))
    return suite


def _case_element(case: _Case, seconds: float) -> ElementTree.Element:
    element = ElementTree.Element(
        "testcase",
        name=xml_text(case.name),
        classname=xml_text(case.place),
        time=f"{seconds:.3f}",
    )
    if case.result is not None:
        said = ElementTree.SubElement(
            element,
            case.result.element,
            type=case.result.type,
            message=xml_text(case.result.message),
        )
        # GitLab shows the text of the element, not its message.
        said.text = xml_text(case.result.message)
    if case.output:
        ElementTree.SubElement(element, "system-out").text = xml_text(case.output)
    return element


def _oracle_case(oracle: CellVerdict, place: str, records: Iterable[RunRow]) -> _Case:
    lines = [
        f"{record.id}: {verdict.outcome}  {evidence_text(verdict)}"
        for record in records
        if (verdict := record.verdict(oracle.oracle)) is not None
    ]
    result = _case_result(oracle, oracle.passed > 0, _summary(oracle))
    return _Case(oracle.oracle, place, result, "\n".join(lines))


def _summary(oracle: CellVerdict) -> str:
    parts = [f"{oracle.passed} of {oracle.n} pass"]
    if oracle.missing:
        parts.append(f"{oracle.missing} without a result ({oracle.state})")
    if oracle.worst is not None:
        parts.append(f"worst in {oracle.worst.run}: {evidence_text(oracle.worst.verdict)}")
        parts.append(oracle.worst.verdict.text)
    return "; ".join(parts)


def _comparison_case(campaign: str, cell: ComparisonVerdict) -> _Case:
    said = f"mean {format_quantity(cell.mean, cell.unit, signed=True)}, n={cell.n}: {cell.text}"
    if cell.note:
        said = f"{said}; {cell.note}"
    result = _case_result(cell, cell.verdict is Outcome.PASS, said)
    return _Case(f"{cell.comparison} {cell.sut}", f"{campaign}.comparisons", result)


def _case_result(
    cell: CellVerdict | ComparisonVerdict, passed: bool, said: str
) -> _CaseResult | None:
    # JUnit knows no expectations and no third verdict. As pytest does: what fails as expected is
    # skipped, what passes against expectation fails; inconclusive is an error, so that a build that
    # shows nothing is not green.
    if cell.expected != "pass" and cell.status is ExpectationStatus.MET:
        if cell.verdict is Outcome.PASS:
            return None
        return _CaseResult("skipped", "xfail", f"xfail: {cell.why}")
    if cell.verdict is Outcome.ERROR:
        return _CaseResult("error", "error", said)
    if cell.expected != "pass" and passed:
        text = f"expected {cell.expected} ({cell.why}), but {said}"
        return _CaseResult("failure", "xpass", text)
    if cell.verdict is Outcome.INCONCLUSIVE:
        return _CaseResult("error", cell.word, said)
    return _CaseResult("failure", "fail", said) if cell.verdict is Outcome.FAIL else None
