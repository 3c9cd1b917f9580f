"""Numbers of a run: those that an oracle measures as well are the same on one page."""

import numpy as np
import pytest

from daemon.analysis.report._safety_buffer import SafetyBuffer
from daemon.analysis.report._tracks import extract_tracks
from daemon.judging.oracles import SignalSampler, judge
from daemon.model.spec import OracleText
from tests.daemon.judging.oracles.traces import along, make_trace, track, with_tree

MEASURED = {
    "error mean": "mean(loc.error)",
    "error p95": "p95(loc.error)",
    "error max": "max(loc.error)",
    "min clearance": "min(clearance)",
    "time in buffer": "time(clearance < 0.7 m)",
    "longest in buffer": "longest(clearance < 0.7 m)",
    "path length": "final(path.length)",
    "duration": "final(elapsed)",
    "recoveries": "final(bt.recoveries)",
}
BUFFER = SafetyBuffer(None, 0.7, "0.7 m")


@pytest.mark.parametrize("count", [21, 41, 61, 81, 101, 181, 401])
def test_a_measure_and_an_oracle_that_measures_the_same_agree(count):
    time = np.arange(count) / 20
    # Each sample has an error of its own, the largest in the middle.
    off = 0.001 * ((np.arange(count) * 7) % count)
    motion = along(time, y=np.linspace(0.0, 0.3, count))
    trace = make_trace(motion, estimate=track(time, motion.x + off, motion.y))
    assert "recoveries" not in measures_of(trace)
    trace = with_tree(trace, (0.1, "Spin 1 IDLE>RUNNING"), (0.5, "Wait 2 IDLE>RUNNING"))
    measures = measures_of(trace)
    verdicts = judge(trace, [OracleText(name, text) for name, text in MEASURED.items()])
    measured = {verdict.oracle: verdict.evidence.value for verdict in verdicts}
    assert {name: measures[name] for name in MEASURED} == pytest.approx(measured)


def measures_of(trace):
    return extract_tracks("run", trace, SignalSampler(trace), BUFFER, (), 200).measures
