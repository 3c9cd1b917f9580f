"""Tables and JUnit files: what machines read says the same as the assessment."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import junitparser
import pytest
from lxml import etree

from daemon.analysis.report import MEASURES, report_table, write_junit
from daemon.model.assessments import Assessment, CellVerdict, ExpectationStatus
from daemon.model.spec import Timing
from daemon.model.verdicts import Outcome
from tests.analysis.report.recordings import OPEN_SHOWN, SHUT, SUTS, WHY, with_assessment
from tests.make import with_result

MET, OPEN, CONTRADICTED = ExpectationStatus


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


def write(data, path):
    write_junit(data.input.row.name, data.assessment, [run.record for run in data.runs], path)


def cases(data, folder):
    path = folder / "results.xml"
    write(data, path)
    return {
        (suite.name, case.name): case
        for suite in junitparser.JUnitXml.fromfile(str(path))
        for case in suite
    }


def test_build_servers_see_failures_known_ones_and_passes(data, tmp_path):
    found = cases(data, tmp_path)
    near, far = SUTS
    (unexpected,) = found[f"{OPEN_SHOWN}/{near}", "buffer"].result
    assert isinstance(unexpected, junitparser.Failure)
    assert "0 of 2 pass" in unexpected.message
    assert "door-17.leaf" in unexpected.message
    (known,) = found[f"{SHUT}/{near}", "buffer"].result
    assert isinstance(known, junitparser.Skipped)
    assert known.message == f"xfail: {WHY}"
    assert found[f"{SHUT}/{far}", "buffer"].result == []
    assert len(found) == 3 * 4 + 2


def only(data, **changes):
    """A campaign of one oracle of one cell, changed."""
    cell = next(c for c in data.assessment.cells if (c.scenario, c.sut) == (SHUT, SUTS[0]))
    oracle = replace(cell.oracles[-1], **changes)
    return with_cell(data, replace(cell, oracles=(oracle,)))


def with_cell(data, cell):
    return with_assessment(data, Assessment((cell,), (), (), 0))


@pytest.mark.parametrize(
    ("changes", "kind", "type_"),
    [
        ({"verdict": Outcome.PASS, "expected": "pass", "status": MET}, None, ""),
        ({"verdict": Outcome.FAIL, "expected": "pass", "status": CONTRADICTED}, "Failure", "fail"),
        ({"verdict": Outcome.ERROR, "expected": "pass", "status": OPEN}, "Error", "error"),
        ({"verdict": Outcome.INCONCLUSIVE, "expected": "pass", "status": OPEN}, "Error",
         "inconclusive"),
        ({"verdict": Outcome.FAIL, "expected": "fail", "status": MET}, "Skipped", "xfail"),
        ({"verdict": Outcome.PASS, "expected": "fail", "status": CONTRADICTED, "passed": 2},
         "Failure", "xpass"),
        ({"verdict": Outcome.FAIL, "expected": "fail", "status": CONTRADICTED, "passed": 1},
         "Failure", "xpass"),
        ({"verdict": Outcome.INCONCLUSIVE, "expected": "fail", "status": OPEN, "passed": 0},
         "Error", "inconclusive"),
        ({"verdict": Outcome.ERROR, "expected": "mixed", "status": OPEN, "passed": 0}, "Error",
         "error"),
        ({"verdict": Outcome.PASS, "expected": "any", "status": MET}, None, ""),
    ],
)  # fmt: skip
def test_each_verdict_has_its_place_in_junit(data, tmp_path, changes, kind, type_):
    (case,) = cases(only(data, **changes), tmp_path).values()
    shown = [(type(result).__name__, result.type) for result in case.result]
    assert shown == ([] if kind is None else [(kind, type_)])


def test_a_cell_that_nothing_judged_is_an_error(data, tmp_path):
    cell = replace(data.assessment.cells[0], oracles=(), verdict=Outcome.ERROR)
    (case,) = cases(with_cell(data, cell), tmp_path).values()
    assert isinstance(case.result[0], junitparser.Error)


def test_names_no_xml_can_hold_are_made_holdable(data, tmp_path):
    oracle = replace(data.assessment.cells[0].oracles[0], oracle="bell \x07", worst=None)
    assert isinstance(oracle, CellVerdict)
    cell = replace(data.assessment.cells[0], oracles=(oracle,), scenario="\x00")
    assert [name for _, name in cases(with_cell(data, cell), tmp_path)] == ["bell \ufffd"]


def test_a_junit_file_is_valid_and_tells_times(data, tmp_path):
    timed = replace(
        data,
        runs=tuple(
            replace(run, record=with_result(run.record, timing=Timing(2.5, 2.0, 40.0)))
            for run in data.runs
        ),
    )
    path = tmp_path / "deep" / "results.xml"
    write(timed, path)
    schema = etree.XMLSchema(etree.parse(str(Path(__file__).with_name("junit.xsd"))))
    schema.assertValid(etree.parse(str(path)))
    root = ET.parse(path).getroot()
    suites = root.findall("testsuite")
    assert float(root.get("time", "")) == pytest.approx(2.5 * len(data.runs), abs=0.01)
    for suite, cell in zip(suites, data.assessment.cells, strict=False):
        assert float(suite.get("time", "")) == pytest.approx(2.5 * len(cell.runs), abs=0.01)
        times = [float(case.get("time", "")) for case in suite.findall("testcase")]
        assert sum(times) == pytest.approx(float(suite.get("time", "")), abs=0.01)
        assert suite.find("properties/property[@name='time']").get("value") == "wall clock"
    for key in ("tests", "failures", "errors"):
        assert int(root.get(key, "")) == sum(int(suite.get(key, "")) for suite in suites)


def test_of_traces_alone_the_time_is_what_they_simulated(data, tmp_path):
    write(data, tmp_path / "results.xml")
    suite = ET.parse(tmp_path / "results.xml").getroot().find("testsuite")
    assert suite is not None
    assert suite.find("properties/property[@name='time']").get("value") == "simulated"
    cell = data.assessment.cells[0]
    simulated = [r.record.result.timing.simulated for r in data.runs if r.record.id in cell.runs]
    assert float(suite.get("time", "")) == pytest.approx(sum(simulated), abs=0.01)
