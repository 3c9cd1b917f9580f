"""The moment that decides: how the robot came there, and what was around it then."""

import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from daemon.analysis.report import draw_moment
from daemon.model.sut import Progress
from daemon.trace import TraceWriter
from grammars.model.geometry import Pose2, Twist2
from tests.daemon.analysis.report.recordings import SHUT, SUTS, spec
from tests.daemon.judging.oracles.traces import CORRIDOR

SPEED, SHUTS, TOUCHES = 0.5, 9.0, 9.5
"""The door begins to shut at 9 s and takes one; the robot is touched at 9.5 s."""


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
        writer.contact(TOUCHES, "robot", "wall-north", (4.75, 1.0), (0.0, 1.0), 0.01)
        writer.close("finished", "")
    return path


def groups(trace, time):
    picture = draw_moment(trace, time)
    assert picture is not None
    return {group.name: group.items for group in picture.drawing.groups}


def footprints(trace, time):
    """The middles of the footprints that are drawn [px], the one that is filled last."""
    found = [
        np.mean(item.rings[0], axis=0)
        for item in groups(trace, time)["driven"]
        if getattr(item, "rings", None) and not item.open
    ]
    return np.array(found)


def crosses(trace, time):
    return [one for one in groups(trace, time)["driven"] if getattr(one, "line", "") == "#c4161c"]


def test_the_robot_is_drawn_as_it_came_there_and_filled_at_the_moment(trace):
    places = footprints(trace, 10.0)
    assert (np.diff(places[:-1, 0]) > 0.0).all()
    assert places[-1] == pytest.approx(places[-2]), "the last one is filled"


@pytest.mark.parametrize(("time", "seconds"), [(10.0, 7.2), (0.0, 1.0), (20.0, 7.0), (99.0, 7.0)])
def test_the_seconds_before_are_shown_also_at_the_ends_of_a_run(trace, time, seconds):
    (way,) = [one for one in groups(trace, time)["driven"] if getattr(one, "width", 0) == 2.6]
    gone = way.rings[0][-1][0] - way.rings[0][0][0]
    # The page is as wide as the way and 0.9 m on both sides, or as high a page allows.
    scale = (620.0 - 2 * 48.0) / max(SPEED * seconds + 1.8, 1.35 * 1.8)
    assert gone / scale == pytest.approx(SPEED * seconds, abs=0.03)


def test_a_contact_is_there_from_the_moment_it_happened(trace):
    assert crosses(trace, TOUCHES)
    assert not crosses(trace, TOUCHES - 1.0)


def test_a_door_is_where_it_was_at_the_moment(trace):
    before, after = (groups(trace, time)["doors"][0] for time in (8.5, 10.5))
    turns = []
    for leaf in (before, after):
        (x0, y0), (x1, y1) = leaf.rings[0][:2]
        turns.append(np.degrees(np.arctan2(y1 - y0, x1 - x0)))
    assert abs(turns[1] - turns[0]) == pytest.approx(np.degrees(1.0), abs=0.5)


def test_the_same_run_gives_the_same_bytes_and_few_of_them(trace):
    once, again = (draw_moment(trace, 10.0) for _ in range(2))
    assert once is not None
    assert again is not None
    svg = once.svg("f0", "a moment")
    assert svg == again.svg("f0", "a moment")
    assert len(svg) < 20_000
    assert not re.search(r"<script|<animate|href=|url\(", svg)
    assert ET.fromstring(svg).get("aria-label") == "a moment"


def test_a_trace_that_is_gone_has_no_moment(tmp_path):
    assert draw_moment(tmp_path / "gone.mcap", 1.0) is None
