"""Maps on a page: the moment that decides, what is red in it, and the ways of repeats."""

import json
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from daemon.analysis.report.run_maps import (
    draw_moment,
    draw_recorded_way,
    draw_run,
    draw_ways,
)
from daemon.model.sut import Estimate, Progress
from daemon.model.verdicts import Evidence, Outcome, Verdict
from daemon.trace import TraceWriter
from grammars.model.geometry import Pose2, Twist2
from scenario_tui.dashboard.playback import open_playback, render_frame
from tests.analysis.report.recordings import SHUT, SUTS, spec
from tests.engine.judging.traces import CORRIDOR

SPEED, SHUTS, TOUCHES, OFF = 0.5, 9.0, 9.5, 0.3
"""The door begins to shut at 9 s and takes one; the robot is touched at 9.5 s.

It believes to be 0.3 m ahead of where it is.
"""
LABEL = 'a "moment" & <b>more</b>'
WIDTH = 620.0


@pytest.fixture(scope="module")
def trace(tmp_path_factory):
    """A robot that drives straight on for 20 s, beside a door that shuts by a radian."""
    path = tmp_path_factory.mktemp("moment") / "run.mcap"
    with TraceWriter(path, spec(SHUT, SUTS[0], 0), CORRIDOR) as writer:
        writer.progress(0.0, Progress(0, 0, "active"))
        for step in range(401):
            now = step / 20
            writer.ground_truth(now, Pose2(SPEED * now, 0.2), Twist2(SPEED, 0.0, 0.0))
            writer.joints(now, np.array([-min(max(now - SHUTS, 0.0), 1.0)]), np.zeros(1))
            if step % 10 == 0:
                believed = Pose2(SPEED * now + OFF, 0.2)
                writer.estimate(Estimate(now, believed, np.diag([0.01, 0.01, 0.01])))
        writer.contact(TOUCHES, "robot", "wall-north", (4.75, 1.0), (0.0, 1.0), 0.01)
        writer.close("finished", "")
    return path


SPEED_LIMIT = "always(speed < 1 m/s)"


def verdict(text="always(clearance >= 0.05 m)", unit="m", **evidence):
    return Verdict("o", text, Outcome.FAIL, -0.1, -0.1, unit, Evidence(**evidence))


def moment(trace, **changes):
    return draw_moment(trace, verdict(**changes), LABEL)


def painted(svg, colour, kind="path"):
    """Return elements of a ``kind`` in the ``colour`` of the page, in the order of painting."""
    value = f"var(--map-{colour},"
    return [
        element
        for element in ET.fromstring(svg).iter(kind)
        if any(element.get(name, "").startswith(value) for name in ("fill", "stroke"))
    ]


def corners(path):
    found = np.array([float(v) for v in re.findall(r"-?[\d.]+", path.get("d"))])
    return found.reshape(-1, 2)


def test_the_robot_is_drawn_as_it_came_there_and_filled_at_the_moment(trace):
    prints = [one for one in painted(moment(trace, time=10.0), "robot") if one.get("stroke")]
    middles = np.array([corners(one).mean(axis=0) for one in prints])
    assert (np.diff(middles[:-1, 0]) > 0.0).all()
    assert middles[-1] == pytest.approx(middles[-2])
    assert prints[-1].get("fill")


def leaf(svg):
    """Return the object that decides."""
    (filled,) = [one for one in painted(svg, "touched") if one.get("fill")]
    return filled


@pytest.mark.parametrize(
    ("time", "seconds"), [(10.0, 7.2), (0.0, 1.0), (20.0, 7.0), (99.0, 7.0), (None, 7.0)]
)
def test_the_seconds_before_are_shown_also_at_the_ends_of_a_run(trace, time, seconds):
    svg = moment(trace, text=SPEED_LIMIT, time=time)
    ways = painted(svg, "driven") + painted(svg, "close")
    places = np.concatenate([corners(way) for way in ways])
    # The page is as wide as the way and 0.9 m on both sides, or as high a page allows.
    scale = WIDTH / max(SPEED * seconds + 1.8, 1.35 * 1.8)
    assert np.ptp(places[:, 0]) / scale == pytest.approx(SPEED * seconds, abs=0.03)


def test_a_contact_is_there_from_the_moment_it_happened(trace):
    assert painted(moment(trace, text=SPEED_LIMIT, time=TOUCHES), "touched")
    assert not painted(moment(trace, text=SPEED_LIMIT, time=TOUCHES - 1.0), "touched")


def test_a_door_is_where_it_was_at_the_moment(trace):
    turns = []
    for time in (8.5, 10.5):
        (x0, y0), (x1, y1) = corners(leaf(moment(trace, time=time, object="door-17.leaf")))[:2]
        turns.append(np.degrees(np.arctan2(y1 - y0, x1 - x0)))
    assert abs(turns[1] - turns[0]) == pytest.approx(np.degrees(1.0), abs=0.5)


def test_what_decides_is_red_with_its_measure(trace):
    svg = moment(trace, time=8.5, value=0.031, limit=0.05, object="wall-north")
    wall, line = painted(svg, "touched")[:2]
    assert wall.get("fill")
    # From the footprint, whose side is 0.25 m left of the middle at 0.2 m, to the wall at 1 m.
    first, last = corners(line)
    scale = WIDTH / (SPEED * 7.2 + 1.8)
    assert np.hypot(*(last - first)) / scale == pytest.approx(1.0 - 0.2 - 0.25, abs=0.1)
    assert [one.text for one in painted(svg, "touched", "text")] == ["0.031 m, limit 0.05 m"]


@pytest.mark.parametrize(
    ("text", "evidence", "words"),
    [
        ("always(loc.error <= 0.2 m)", {"value": OFF, "limit": 0.2}, "0.300 m, limit 0.2 m"),
        ("reached(mission, 0.5 m)", {"object": "w1", "limit": 0.5}, "waypoint 1: 4.767 m"),
        ("never(contact)", {"object": "door-17"}, " m"),
    ],
)
def test_what_decides_is_measured_whatever_it_is(trace, text, evidence, words):
    svg = moment(trace, text=text, time=8.5, **evidence)
    (label,) = painted(svg, "touched", "text")
    assert label.text.endswith(words)


def test_nothing_is_red_when_a_verdict_has_no_place_or_does_not_fail(trace):
    assert not painted(moment(trace, text="always(speed < 0.1 m/s)", time=5.0), "touched")
    passes = replace(verdict(time=5.0, value=0.3, object="wall-north"), outcome=Outcome.PASS)
    svg = draw_moment(trace, passes, LABEL)
    assert not painted(svg, "touched")
    assert "0.300 m" in [one.text for one in painted(svg, "ink", "text")]


def test_the_same_run_gives_the_same_bytes_and_few_of_them(trace):
    svg = moment(trace, time=10.0, object="wall-north")
    assert svg == moment(trace, time=10.0, object="wall-north")
    assert len(svg) < 20_000
    assert not re.search(r"<script|<animate|href=|url\(| id=", svg)
    assert ET.fromstring(svg).get("aria-label") == LABEL


def test_a_trace_that_is_gone_has_no_map(tmp_path):
    assert draw_moment(tmp_path / "gone.mcap", verdict(), LABEL) is None
    assert draw_recorded_way(tmp_path / "gone.mcap", LABEL, None) is None


def test_scripts_find_where_each_repeat_was_at_a_time(data):
    runs = {run.record.repeat: run.tracks for run in data.runs if run.record.sut == SUTS[0]}
    svg = draw_ways(runs, Path(data.runs[0].record.trace), LABEL)
    root = ET.fromstring(svg)
    ways = json.loads(root.get("data-way"))
    assert [way["repeat"] for way in ways] == list(runs)
    _, _, width, height = map(float, root.get("viewBox").split())
    for way in ways:
        assert len(way["t"]) == len(way["x"]) == len(way["y"])
        assert way["t"][0] == 0.0
        assert (np.diff(way["x"]) > 0.0).all()
        assert 0.0 < way["x"][0] < way["x"][-1] < width
        assert 0.0 < way["y"][0] < height
    assert root.find("g[@class='driven']") is not None
    # 0.6 m left of the middle of a corridor 2 m wide: inside of the buffer all the time.
    assert painted(svg, "close")
    assert not painted(svg, "driven")


def test_what_decided_a_repeat_is_red_on_the_map_of_all(trace):
    svg = draw_recorded_way(trace, LABEL, verdict(time=8.5, value=0.031, object="door-17.leaf"))
    assert leaf(svg) is not None
    assert [one.text for one in painted(svg, "touched", "text")] == ["0.031 m"]


def test_a_run_that_cannot_be_trusted_is_drawn_as_far_as_it_has_places(tmp_path):
    path, picture = tmp_path / "run.mcap", tmp_path / "run.svg"
    with TraceWriter(path, spec(SHUT, SUTS[0], 0), CORRIDOR) as writer:
        for step in range(40):
            x = SPEED * step / 20 if step < 30 else np.nan
            writer.ground_truth(step / 20, Pose2(x, 0.2), Twist2(SPEED, 0.0, 0.0))
        writer.close("finished", "")
    draw_run(path, picture)
    assert "not to be trusted: the ground truth at 1.5 s is not a number" in picture.read_text()
    assert "nan" not in picture.read_text()
    frame = render_frame(open_playback(path), 1.8, 80, 23)
    assert any("error" in line.plain for line in frame)
