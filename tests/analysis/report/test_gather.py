"""What a report takes from traces: numbers by hand, tracks that keep what matters."""

import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.analysis.recorded import read_traces
from daemon.analysis.report import (
    oracle_limit,
    read_report_data,
    safety_buffer,
    thinned_indices,
)
from daemon.analysis.results import read_results
from daemon.batch.errors import Refused
from daemon.campaign import expand, load_campaign
from daemon.model.verdicts import Outcome
from tests.analysis.report.recordings import (
    ABOUT,
    DECLARED,
    LATERAL,
    NAME,
    OPEN,
    REPEATS,
    SECONDS,
    SHUT,
    SPEED,
    SUTS,
    report_of,
)

PAPER = Path("ortega2024") / "paper.yaml"


def run_of(data, scenario, sut, repeat=0):
    (found,) = [
        run
        for run in data.runs
        if (run.record.scenario, run.record.sut, run.record.repeat) == (scenario, sut, repeat)
    ]
    return found


def test_a_folder_is_a_campaign_with_what_it_declares(folder):
    chosen = read_traces(str(folder))
    assert (chosen.row.name, chosen.row.about) == (NAME, ABOUT)
    assert chosen.declared(str(folder)) == DECLARED
    assert len(chosen.rows) == 4 * REPEATS


def test_traces_without_a_note_must_all_pass(folder, tmp_path):
    for trace in folder.glob("*.mcap"):
        (tmp_path / trace.name).symlink_to(trace)
    chosen = read_traces(str(tmp_path))
    assert (chosen.row.name, chosen.declared(chosen.row.id).expectations) == (NAME, ())
    assert report_of(tmp_path).assessment.exit_code == 1


def test_runs_are_judged_and_assessed(data):
    near = run_of(data, SHUT, SUTS[0])
    assert near.record.outcome is Outcome.FAIL
    assert run_of(data, SHUT, SUTS[1]).record.outcome is Outcome.PASS
    (surprise,) = data.assessment.surprises
    assert (surprise.scenario, surprise.sut, surprise.oracle) == (OPEN, SUTS[0], "buffer")


def test_measures_are_those_of_plain_geometry(data):
    found = run_of(data, OPEN, SUTS[0], 1).tracks.measures
    # The leaf of the door stands 2 cm out of the wall at y = 1 m.
    nearest = 1.0 - 0.02 - LATERAL[SUTS[0]] - 0.233
    assert found["min clearance"] == pytest.approx(nearest, abs=1e-9)
    assert found["time in buffer"] == pytest.approx(SECONDS)
    assert found["longest in buffer"] == pytest.approx(SECONDS)
    assert found["path length"] == pytest.approx(SPEED * SECONDS)
    assert found["max speed in buffer"] == pytest.approx(SPEED)
    for name in ("error mean", "error median", "error p95", "error max"):
        assert found[name] == pytest.approx(0.12, abs=1e-9)
    assert found["inside 2 sigma"] == pytest.approx(1.0)
    assert "speed at trigger" not in found


def test_the_far_robot_has_nothing_in_its_buffer(data):
    measures = run_of(data, SHUT, SUTS[1]).tracks.measures
    assert measures["time in buffer"] == 0.0
    assert "max speed in buffer" not in measures


def test_laser_returns_in_the_buffer_are_seen_from_the_robot(data):
    near, far = (run_of(data, OPEN, sut).tracks.returns for sut in SUTS)
    assert len(near) == round(SECONDS) + 1
    angle, beside = math.radians(-114.592 + 161 * 1.273240), 1.0 - LATERAL[SUTS[0]]
    seen = (0.25 + beside * math.cos(angle), beside * math.sin(angle))
    assert near == pytest.approx(np.tile(seen, (len(near), 1)), abs=1e-4)
    assert far.shape == (0, 2)


def test_a_door_that_shuts_and_the_same_door_that_does_not(data):
    (fired,) = run_of(data, SHUT, SUTS[0]).tracks.encounters
    assert (fired.fired, fired.time, fired.speed_then) == (True, 14.0, SPEED)
    (would,) = run_of(data, OPEN, SUTS[0]).tracks.encounters
    assert not would.fired
    ahead = math.sqrt(1.3**2 - (1.0 - LATERAL[SUTS[0]]) ** 2)
    assert would.time == pytest.approx((8.0 - ahead) / SPEED, abs=0.051)


def test_contacts_are_kept(data):
    assert run_of(data, OPEN, SUTS[0]).tracks.contacts == ((5.0, "wall-north", 2.5, 1.0),)


def copied(folder, to):
    return [Path(shutil.copy(trace, to)) for trace in sorted(folder.glob("*.mcap"))]


def test_what_is_no_trace_is_named_and_left_out(folder, tmp_path):
    copied(folder, tmp_path)[0].write_bytes(b"nothing of the kind")
    chosen = read_traces(str(tmp_path))
    ((file, why),) = chosen.unread
    assert file.endswith(".mcap")
    assert why == "is not an MCAP file"
    assert len(chosen.rows) == 4 * REPEATS - 1


def test_a_trace_that_was_cut_is_judged_as_far_as_it_goes(folder, tmp_path):
    first = copied(folder, tmp_path)[0]
    first.write_bytes(first.read_bytes()[:-9000])
    data = report_of(tmp_path)
    (cut,) = [run for run in data.runs if run.record.trace == str(first)]
    assert cut.record.ended == ""
    assert cut.record.outcome in (Outcome.INCONCLUSIVE, Outcome.FAIL, Outcome.ERROR)


def test_a_trace_that_went_away_leaves_its_run(folder, tmp_path):
    copied(folder, tmp_path)
    chosen = read_traces(str(tmp_path))
    Path(chosen.rows[0].trace).unlink()
    data = read_report_data(read_results(chosen, chosen.row), (), processes=1)
    assert "cannot be read" in data.runs[0].tracks.problem
    assert data.runs[0].record.outcome is None


def test_a_folder_without_traces_is_refused(tmp_path):
    with pytest.raises(Refused, match="holds no traces"):
        read_traces(str(tmp_path))


def test_a_folder_whose_note_tells_no_moment_is_refused(folder, tmp_path):
    copied(folder, tmp_path)
    note = {"name": "n", "about": "", "declared": {}, "submitted_at": 1e300}
    (tmp_path / "campaign.json").write_text(json.dumps(note), encoding="utf-8")
    with pytest.raises(Refused, match=r"campaign\.json is not what `scenario run` leaves"):
        read_traces(str(tmp_path))


def test_many_processes_find_the_same(folder, data):
    spread = report_of(folder, processes=2)
    assert [run.record for run in spread.runs] == [run.record for run in data.runs]
    assert [r.tracks.measures for r in spread.runs] == [r.tracks.measures for r in data.runs]


@pytest.mark.parametrize(
    ("texts", "half", "margin"),
    [
        (("always(clearance(0.55 m, 0.433 m) >= 0 m)", "never(clearance(0.35 m, 0.2 m) <= 0 m)"),
         (0.55, 0.433), 0.0),
        (("always(clearance >= 5 cm)", "min(clearance)"), None, 0.05),
        (("reached(mission, 0.25 m)", "no oracle at all"), None, 0.2),
    ],
)  # fmt: skip
def test_the_buffer_is_what_the_oracles_speak_of(texts, half, margin):
    found = safety_buffer(texts)
    assert (found.half, found.margin) == (half, pytest.approx(margin))


def test_a_box_narrower_than_the_robot_is_where_a_collision_begins(campaigns):
    """S2 of the paper asks for no collision and names no buffer: its box is no room around it."""
    runs = {run.scenario: run for run in expand(load_campaign(campaigns / PAPER)).specs}
    found = {}
    for name in ("S2", "S3.1"):
        texts = tuple(oracle.text for oracle in runs[name].oracles)
        assert any("clearance(0.35 m, 0.20 m)" in text for text in texts)
        found[name] = safety_buffer(texts, (runs[name].robot.footprint,))
    assert (found["S2"].half, found["S2"].margin) == (None, pytest.approx(0.2))
    assert "no oracle names" in found["S2"].source
    assert found["S3.1"].half == (0.55, 0.433)


def test_the_limit_of_a_signal_is_the_strictest():
    texts = ("always(loc.error <= 0.35 m)", "never(loc.error > 1 m)", "max(loc.error) < 30 cm")
    assert oracle_limit(texts, "loc.error") == pytest.approx(0.3)
    assert oracle_limit(("mean(loc.error) <= 0.1 m",), "loc.error") is None
    assert oracle_limit(texts, "clearance") is None


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
