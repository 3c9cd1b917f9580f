"""Tables and JUnit files: what machines read says the same as the assessment."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import junitparser
import pytest
from lxml import etree

from daemon.analysis.report import MEASURES, report_table, write_junit
from daemon.model.assessments import Assessment, ExpectationStatus
from daemon.model.spec import Timing
from daemon.model.verdicts import Outcome
from tests.analysis.report.recordings import OPEN_SHOWN, SHUT, SUTS, WHY, with_assessment
from tests.make import with_result

MET, OPEN, CONTRADICTED = ExpectationStatus
NEAR, FAR = SUTS
SCHEMA = etree.XMLSchema(etree.parse(str(Path(__file__).with_name("junit.xsd"))))


def test_the_table_has_every_measure_and_margin(data):
    rows = report_table(data).to_pylist()
    found = {(row["run"], row["oracle"]): row for row in rows}
    assert len(found) == len(rows)
    for run in data.runs:
        for measure in MEASURES:
            if measure.name in run.tracks.measures:
                row = found[run.record.id, measure.name]
                assert row["value"] == run.tracks.measures[measure.name]
                assert (row["verdict"], row["unit"]) == ("measure", measure.unit)
        for verdict in run.record.verdicts:
            assert found[run.record.id, verdict.oracle]["margin"] == verdict.margin


@pytest.fixture
def junit(tmp_path):
    """Write the file of a report; return the path."""

    def write(data):
        path = tmp_path / "deep" / "results.xml"
        write_junit(data.input.row.name, data.assessment, [r.record for r in data.runs], path)
        return path

    return write


@pytest.fixture
def cases(junit):
    """The cases of the file of a report, by suite and name."""

    def read(data):
        suites = junitparser.JUnitXml.fromfile(str(junit(data)))
        return {(suite.name, case.name): case for suite in suites for case in suite}

    return read


def with_cell(data, index=0, **changes):
    """A campaign of one cell, changed."""
    cell = replace(data.assessment.cells[index], **changes)
    return with_assessment(data, Assessment((cell,), (), (), 0))


def test_build_servers_see_failures_known_ones_and_passes(data, cases):
    found = cases(data)
    (unexpected,) = found[f"{OPEN_SHOWN}/{NEAR}", "buffer"].result
    assert isinstance(unexpected, junitparser.Failure)
    assert "0 of 2 pass" in unexpected.message
    assert "door-17.leaf" in unexpected.message
    (known,) = found[f"{SHUT}/{NEAR}", "buffer"].result
    assert isinstance(known, junitparser.Skipped)
    assert known.message == f"xfail: {WHY}"
    assert found[f"{SHUT}/{FAR}", "buffer"].result == []
    assert len(found) == 3 * 4 + 2


@pytest.mark.parametrize(
    ("verdict", "expected", "status", "passed", "kind", "type_"),
    [
        (Outcome.PASS, "pass", MET, 2, None, ""),
        (Outcome.FAIL, "pass", CONTRADICTED, 2, "Failure", "fail"),
        (Outcome.ERROR, "pass", OPEN, 2, "Error", "error"),
        (Outcome.INCONCLUSIVE, "pass", OPEN, 2, "Error", "inconclusive"),
        (Outcome.FAIL, "fail", MET, 2, "Skipped", "xfail"),
        (Outcome.PASS, "fail", CONTRADICTED, 2, "Failure", "xpass"),
        (Outcome.FAIL, "fail", CONTRADICTED, 1, "Failure", "xpass"),
        (Outcome.INCONCLUSIVE, "fail", OPEN, 0, "Error", "inconclusive"),
        (Outcome.ERROR, "mixed", OPEN, 0, "Error", "error"),
        (Outcome.PASS, "any", MET, 2, None, ""),
    ],
)
def test_each_verdict_has_its_place_in_junit(
    data, cases, verdict, expected, status, passed, kind, type_
):
    oracle = data.assessment.cells[0].oracles[-1]
    oracle = replace(oracle, verdict=verdict, expected=expected, status=status, passed=passed)
    (case,) = cases(with_cell(data, oracles=(oracle,))).values()
    shown = [(type(result).__name__, result.type) for result in case.result]
    assert shown == ([] if kind is None else [(kind, type_)])


def test_a_cell_that_nothing_judged_is_an_error(data, cases):
    (case,) = cases(with_cell(data, oracles=(), verdict=Outcome.ERROR)).values()
    assert isinstance(case.result[0], junitparser.Error)


def test_names_no_xml_can_hold_are_made_holdable(data, cases):
    oracle = replace(data.assessment.cells[0].oracles[0], oracle="bell \x07", worst=None)
    found = cases(with_cell(data, oracles=(oracle,), scenario="\x00"))
    assert [name for _, name in found] == ["bell \ufffd"]


def test_a_junit_file_is_valid_and_tells_times(data, junit):
    runs = (
        replace(run, record=with_result(run.record, timing=Timing(2.5, 2.0, 40.0)))
        for run in data.runs
    )
    path = junit(replace(data, runs=tuple(runs)))
    SCHEMA.assertValid(etree.parse(str(path)))
    root = ET.parse(path).getroot()
    suites = root.findall("testsuite")
    assert float(root.get("time")) == pytest.approx(2.5 * len(data.runs), abs=0.01)
    for suite, cell in zip(suites, data.assessment.cells, strict=False):
        assert float(suite.get("time")) == pytest.approx(2.5 * len(cell.runs), abs=0.01)
        times = [float(case.get("time")) for case in suite.findall("testcase")]
        assert sum(times) == pytest.approx(float(suite.get("time")), abs=0.01)
        assert suite.find("properties/property[@name='time']").get("value") == "wall clock"
    for key in ("tests", "failures", "errors"):
        assert int(root.get(key)) == sum(int(suite.get(key)) for suite in suites)


def test_of_traces_alone_the_time_is_the_simulated_one(data, junit):
    suite = ET.parse(junit(data)).getroot().find("testsuite")
    assert suite.find("properties/property[@name='time']").get("value") == "simulated"
    cell = data.assessment.cells[0]
    simulated = [r.record.result.timing.simulated for r in data.runs if r.record.id in cell.runs]
    assert float(suite.get("time")) == pytest.approx(sum(simulated), abs=0.01)
