"""Measures of a run: each is what the oracle in its text says, by the same engine."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.analysis.report._data import measure_columns
from daemon.analysis.report._measures import (
    measured_values,
    standard_names,
    standard_oracles,
)
from daemon.analysis.report._safety_buffer import SafetyBuffer
from daemon.judging.oracles import judge
from tests.analysis.report.recordings import OPEN, SUTS
from tests.engine.judging.traces import along, make_trace, track, with_tree

BOX = SafetyBuffer((0.55, 0.433), 0.0, "")
MARGIN = SafetyBuffer(None, 0.7, "")


def test_a_declared_measure_shares_the_column_of_the_standard_one_that_means_the_same(data):
    columns = {column.measure.name: column for column in measure_columns(data)}
    assert columns["time in buffer"].measure.declared == ("buffer-time",)
    assert "buffer-time" not in columns
    # The same name and another text, in one of the scenarios, is another measure.
    text = "time(clearance < 0.1 m)"
    runs = tuple(with_text(run, text) if run.record.scenario == OPEN else run for run in data.runs)
    columns = {column.measure.name: column for column in measure_columns(replace(data, runs=runs))}
    assert columns["time in buffer"].measure.declared == ("buffer-time",)
    assert columns["buffer-time"].measure.text == text
    assert set(columns["buffer-time"].values) == {(OPEN, sut) for sut in SUTS}


def with_text(run, text):
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
