"""JUnit XML for build servers: a suite for each cell, a case for each of its oracles.

It follows the schema of Jenkins' xUnit plug-in (``junit-10.xsd``), which includes everything that
GitLab and GitHub actions read.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

from junitparser import Error, Failure, JUnitXml, Skipped, TestCase, TestSuite
from junitparser.junitparser import FinalResult

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
from grammars.text.words import format_quantity
from templates.naming import xml_text


def write_junit(name: str, assessment: Assessment, records: Sequence[RunRow], path: Path) -> None:
    """Write the assessment of a campaign's runs as JUnit XML.

    FAIL is a failure, ERROR an error, INCONCLUSIVE an error of type ``inconclusive``, or of the
    state of missing runs (``queued``, ``lost`` ...). An expected failure is skipped (``xfail:
    why``), an unexpected pass is a failure of type ``xpass``.

    The time of a suite is the wall clock time of its runs [s], for mere traces the simulated time;
    a property says which. One run serves every oracle, so each case has an equal share of it.
    Raises ``OSError`` if the file cannot be written.
    """
    runs = {record.id: record for record in records}
    root = JUnitXml(xml_text(name))
    for cell in assessment.cells:
        root.append(_cell_suite(name, cell, [runs[run] for run in cell.runs if run in runs]))
    if assessment.comparisons:
        cases = [_comparison_case(name, comparison) for comparison in assessment.comparisons]
        root.append(_suite("comparisons", cases, 0.0, {}))
    root.update_statistics()
    tree = ElementTree.fromstring(root.tostring())
    # The schema of Jenkins does not have this sum.
    del tree.attrib["skipped"]
    ElementTree.indent(tree)
    text = ElementTree.tostring(tree, encoding="utf-8", xml_declaration=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, text + b"\n")


def _cell_suite(campaign: str, cell: CellAssessment, records: Sequence[RunRow]) -> TestSuite:
    place = f"{campaign}.{cell.scenario}.{cell.sut}"
    cases = [_oracle_case(oracle, place, records) for oracle in cell.oracles]
    if not cases:
        message = "no run was judged by any oracle"
        if cell.state != "done":
            message = f"no run has a result: {cell.state}"
        cases = [_case("runs", place, Error(message, cell.word))]
    timings = [record.result.timing for record in records if record.result is not None]
    seconds, clock = sum(timing.wall for timing in timings), "wall clock"
    if not seconds:
        # Traces only contain the simulated time.
        seconds, clock = sum(timing.simulated for timing in timings), "simulated"
    about = {"runs": str(len(cell.runs)), "time": clock}
    return _suite(f"{cell.scenario}/{cell.sut}", cases, seconds, about)


def _suite(name: str, cases: list[TestCase], seconds: float, about: Mapping[str, str]) -> TestSuite:
    suite = TestSuite(xml_text(name))
    for key, value in about.items():
        suite.add_property(key, value)
    for case in cases:
        case.time = round(seconds / len(cases), 3)
    suite.add_testcases(cases)
    return suite


def _case(name: str, place: str, result: FinalResult | None, output: str = "") -> TestCase:
    case = TestCase(xml_text(name), xml_text(place))
    if result is not None:
        # GitLab shows the text of the element, not its message.
        result.text = result.message
        case.result = result
    if output:
        case.system_out = xml_text(output)
    return case


def _oracle_case(oracle: CellVerdict, place: str, records: Iterable[RunRow]) -> TestCase:
    lines = [
        f"{record.id}: {verdict.outcome}  {evidence_text(verdict)}"
        for record in records
        if (verdict := record.verdict(oracle.oracle)) is not None
    ]
    result = _result(oracle, oracle.passed > 0, _summary(oracle))
    return _case(oracle.oracle, place, result, "\n".join(lines))


def _summary(oracle: CellVerdict) -> str:
    parts = [f"{oracle.passed} of {oracle.n} pass"]
    if oracle.missing:
        parts.append(f"{oracle.missing} without a result ({oracle.state})")
    if oracle.worst is not None:
        parts.append(f"worst in {oracle.worst.run}: {evidence_text(oracle.worst.verdict)}")
        parts.append(oracle.worst.verdict.text)
    return "; ".join(parts)


def _comparison_case(campaign: str, cell: ComparisonVerdict) -> TestCase:
    message = f"mean {format_quantity(cell.mean, cell.unit, signed=True)}, n={cell.n}: {cell.text}"
    if cell.note:
        message = f"{message}; {cell.note}"
    result = _result(cell, cell.verdict is Outcome.PASS, message)
    return _case(f"{cell.comparison} {cell.sut}", f"{campaign}.comparisons", result)


def _result(
    cell: CellVerdict | ComparisonVerdict, passed: bool, message: str
) -> FinalResult | None:
    # JUnit has neither expectations nor a third verdict. As in pytest, an expected failure is
    # skipped and an unexpected pass fails. Inconclusive is an error, so that a build without
    # evidence is not green.
    message, why = xml_text(message), xml_text(cell.why)
    if cell.expected != "pass" and cell.status is ExpectationStatus.MET:
        if cell.verdict is Outcome.PASS:
            return None
        return Skipped(f"xfail: {why}", "xfail")
    if cell.verdict is Outcome.ERROR:
        return Error(message, "error")
    if cell.expected != "pass" and passed:
        return Failure(f"expected {cell.expected} ({why}), but {message}", "xpass")
    if cell.verdict is Outcome.INCONCLUSIVE:
        return Error(message, cell.word)
    return Failure(message, "fail") if cell.verdict is Outcome.FAIL else None
