"""What a report takes from traces, by hand, and what machines read of it: tables, JUnit files."""

import math
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from daemon.analysis.recorded import read_traces
from daemon.analysis.report import read_report_data, report_table, write_junit
from daemon.analysis.report._data import measure_columns
from daemon.analysis.report._measures import (
    SafetyBuffer,
    error_limit,
    measured_values,
    safety_buffer,
    standard_measures,
    standard_names,
    standard_oracles,
)
from daemon.analysis.report._tracks import thinned_indices
from daemon.analysis.results import read_results
from daemon.judging.oracles import judge
from daemon.model.assessments import Assessment, ExpectationStatus
from daemon.model.spec import Timing
from daemon.model.verdicts import Outcome
from tests.analysis.report.recordings import (
    LATERAL,
    OPEN,
    SECONDS,
    SHUT,
    SPEED,
    SUTS,
)
from tests.engine.judging.traces import along, make_trace, track, with_tree
from tests.make import with_result

NEAR, FAR = SUTS
BOX = SafetyBuffer((0.55, 0.433), 0.0, "")
MARGIN = SafetyBuffer(None, 0.7, "")


@pytest.fixture
def run_of(data):
    def find(scenario, sut, repeat=0):
        names = scenario, sut, repeat
        return next(
            r for r in data.runs if (r.record.scenario, r.record.sut, r.record.repeat) == names
        )

    return find


def test_measures_are_those_of_plain_geometry(run_of):
    # The leaf of the door stands 2 cm out of the wall at y = 1 m.
    nearest = 1.0 - 0.02 - LATERAL[NEAR] - 0.233
    errors = dict.fromkeys(("error mean", "error median", "error p95", "error max"), 0.12)
    measures = run_of(OPEN, NEAR, 1).tracks.measures
    assert measures == pytest.approx(errors | {
        "duration": SECONDS,
        "path length": SPEED * SECONDS,
        "min clearance": nearest,
        "time in buffer": SECONDS,
        "longest in buffer": SECONDS,
        "max speed in buffer": SPEED,
        "inside 2 sigma": 1.0,
    })  # fmt: skip
    far = run_of(SHUT, FAR).tracks.measures
    assert far["time in buffer"] == 0.0
    assert "max speed in buffer" not in far


def test_laser_returns_in_the_buffer_are_seen_from_the_robot(run_of):
    near, far = (run_of(OPEN, sut).tracks.returns for sut in SUTS)
    assert len(near) == round(SECONDS) + 1
    angle, beside = math.radians(-114.592 + 161 * 1.273240), 1.0 - LATERAL[NEAR]
    seen = (0.25 + beside * math.cos(angle), beside * math.sin(angle))
    assert near == pytest.approx(np.tile(seen, (len(near), 1)), abs=1e-4)
    assert far.shape == (0, 2)


def test_a_door_that_shuts_and_the_same_door_that_does_not(run_of):
    (fired,) = run_of(SHUT, NEAR).tracks.encounters
    assert (fired.fired, fired.time, fired.speed_then) == (True, 14.0, SPEED)
    assert fired.since.min() < 0.0 < fired.since.max(), "seconds before and after"
    tracks = run_of(OPEN, NEAR).tracks
    (would,) = tracks.encounters
    assert not would.fired
    ahead = math.sqrt(1.3**2 - (1.0 - LATERAL[NEAR]) ** 2)
    assert would.time == pytest.approx((8.0 - ahead) / SPEED, abs=0.051)
    assert tracks.contacts == ((5.0, "wall-north", 2.5, 1.0),)


def test_a_trace_that_went_away_leaves_its_run(folder, tmp_path):
    for trace in folder.glob("*.mcap"):
        shutil.copy(trace, tmp_path)
    source = read_traces(str(tmp_path))
    Path(source.rows[0].trace).unlink()
    data = read_report_data(read_results(source, source.row), (), processes=1)
    assert "cannot be read" in data.runs[0].tracks.problem
    assert data.runs[0].record.outcome is None


COLLISION = "never(clearance(0.5 m, 0.2 m) <= 0 m)"
FOOTPRINT = ((-0.35, -0.233), (0.35, -0.233), (0.35, 0.233), (-0.35, 0.233))


@pytest.mark.parametrize(
    ("texts", "footprints", "half", "margin"),
    [
        (("always(clearance(0.55 m, 0.433 m) >= 0 m)", COLLISION), (), (0.55, 0.433), 0.0),
        (("always(clearance(0.55 m, 0.433 m) >= 0 m)", COLLISION), (FOOTPRINT,),
         (0.55, 0.433), 0.0),
        # A box that is narrower than the robot is no room around it.
        ((COLLISION,), (FOOTPRINT,), None, 0.2),
        (("always(clearance >= 5 cm)", "min(clearance)"), (), None, 0.05),
        (("reached(mission, 0.25 m)", "no oracle at all"), (), None, 0.2),
    ],
)  # fmt: skip
def test_the_buffer_is_that_of_the_oracles(texts, footprints, half, margin):
    buffer = safety_buffer(texts, footprints)
    assert (buffer.half, buffer.margin) == (half, pytest.approx(margin))
    assert ("no oracle names" in buffer.source) is (margin == 0.2)


def test_the_limit_of_a_signal_is_the_strictest():
    texts = ("always(loc.error <= 0.35 m)", "never(loc.error > 1 m)", "max(loc.error) < 30 cm")
    assert error_limit(texts) == pytest.approx(0.3)
    assert error_limit(("mean(loc.error) <= 0.1 m",)) is None
    assert error_limit(("always(clearance <= 1 m)",)) is None


@given(
    st.lists(st.floats(-5.0, 5.0), min_size=1, max_size=400),
    st.integers(0, 399),
    st.integers(10, 200),
)
def test_thinning_keeps_the_deepest_dip_and_the_highest_peak(values, shift, points):
    clearance = np.array(values)
    error = np.roll(clearance, shift)
    kept = thinned_indices(clearance, error, points)
    assert (np.diff(kept) > 0).all()
    assert (kept[0], kept[-1]) == (0, len(values) - 1)
    assert clearance[kept].min() == clearance.min()
    assert error[kept].max() == error.max()
    assert len(kept) <= max(points + 4, 4) or len(kept) <= 2 * points


def test_a_declared_measure_shares_the_column_of_the_standard_one_that_means_the_same(data):
    columns = {column.measure.name: column for column in measure_columns(data)}
    assert columns["time in buffer"].declared == ["buffer-time"]
    assert "buffer-time" not in columns
    # The same name and another text, in one of the scenarios, is another measure.
    text = "time(clearance < 0.1 m)"
    runs = tuple(with_text(run, text) if run.record.scenario == OPEN else run for run in data.runs)
    columns = {column.measure.name: column for column in measure_columns(replace(data, runs=runs))}
    assert columns["time in buffer"].declared == ["buffer-time"]
    assert columns["buffer-time"].measure.text == text
    assert set(columns["buffer-time"].values) == {(OPEN, sut) for sut in SUTS}


def with_text(run, text):
    """The same run with another text of the oracle ``buffer-time``."""
    verdicts = tuple(
        replace(v, text=text) if v.oracle == "buffer-time" else v for v in run.record.verdicts
    )
    result = replace(run.record.result, verdicts=verdicts)
    return replace(run, record=replace(run.record, result=result))


@pytest.mark.parametrize(
    ("text", "buffer", "name"),
    [
        ("final( elapsed )", BOX, "duration"),
        ("time(clearance(55 cm, 0.4330 m) < 0 m)", BOX, "time in buffer"),
        ("time(clearance < 70 cm)", MARGIN, "time in buffer"),
        ("time(clearance < 70 cm)", BOX, None),
        ("max(speed) when clearance < 0.7 m", MARGIN, "max speed in buffer"),
        ("max(speed)", MARGIN, None),
        ("max(loc.error) <= 1 m", BOX, None),
        ("max(loc.error) on leg 2", BOX, None),
        ("no oracle", BOX, None),
    ],
)
def test_a_measure_is_known_by_its_meaning(text, buffer, name):
    assert standard_names({"any": text}, buffer).get("any") == name


def test_recoveries_count_where_a_behaviour_tree_is_recorded():
    time = np.arange(21) / 20
    motion = along(time)
    trace = make_trace(motion, estimate=track(time, motion.x, motion.y))
    assert "recoveries" not in measured_values(judge(trace, standard_oracles(BOX)))
    trace = with_tree(trace, (0.1, "Spin 1 IDLE>RUNNING"), (0.5, "Wait 2 IDLE>RUNNING"))
    assert measured_values(judge(trace, standard_oracles(BOX)))["recoveries"] == 2.0


MET, WAITS, CONTRADICTED = ExpectationStatus
SCHEMA = etree.XMLSchema(etree.parse(str(Path(__file__).with_name("junit.xsd"))))


def test_the_table_has_every_measure_and_margin(data):
    rows = report_table(data).to_pylist()
    found = {(row["run"], row["oracle"]): row for row in rows}
    assert len(found) == len(rows)
    for run in data.runs:
        for measure in standard_measures(data.buffer):
            if measure.name in run.tracks.measures:
                row = found[run.record.id, measure.name]
                assert row["value"] == run.tracks.measures[measure.name]
                assert (row["verdict"], row["unit"]) == ("measure", measure.unit)
        for verdict in run.record.verdicts:
            assert found[run.record.id, verdict.oracle]["margin"] == verdict.margin


def test_build_servers_read_every_verdict(data, folder, tmp_path, golden):
    """A campaign as it was recorded; then one cell of all sorts, one that nothing has judged."""
    cell = replace(data.assessment.cells[0], sut="bell \x07")
    oracles = tuple(
        replace(cell.oracles[-1], worst=None, oracle=f"{verdict}, expected {expected}: {status}",
                verdict=verdict, expected=expected, status=status, passed=passed)
        for verdict, expected, status, passed in (
            (Outcome.PASS, "pass", MET, 2),
            (Outcome.FAIL, "pass", CONTRADICTED, 2),
            (Outcome.ERROR, "pass", WAITS, 2),
            (Outcome.INCONCLUSIVE, "pass", WAITS, 2),
            (Outcome.FAIL, "fail", MET, 2),
            (Outcome.PASS, "fail", CONTRADICTED, 2),
            (Outcome.FAIL, "fail", CONTRADICTED, 1),
            (Outcome.INCONCLUSIVE, "fail", WAITS, 0),
            (Outcome.ERROR, "mixed", WAITS, 0),
            (Outcome.PASS, "any", MET, 2),
        )
    )  # fmt: skip
    cells = replace(cell, oracles=oracles), replace(cell, oracles=(), verdict=Outcome.ERROR)
    records = [run.record for run in data.runs]
    timed = [with_result(one, timing=Timing(2.5, 2.0, 40.0)) for one in records]
    path, texts = tmp_path / "deep" / "results.xml", []
    for assessment, runs in ((data.assessment, records), (Assessment(cells, (), (), 0), timed)):
        write_junit(data.input.row.name, assessment, runs, path)
        SCHEMA.assertValid(etree.parse(str(path)))
        texts.append(path.read_text("utf-8").replace(str(folder), "FOLDER"))
    golden("junit.xml", "\n".join(texts))
