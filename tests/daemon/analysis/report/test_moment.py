"""The ten seconds around a moment: what moves in the picture is what moved in the run."""

import re
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from daemon.analysis.report import plot_recorded_moment
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


def drawn(trace, time):
    picture = plot_recorded_moment(trace, time, "wall-north")
    assert picture is not None
    return ET.fromstring(picture.svg("f0", "a moment"))


def animated(figure, kind):
    """The values of all movements of a kind, those that go farthest first."""
    found = [
        [[float(part) for part in value.split()] for value in str(e.get("values")).split(";")]
        for e in figure.iter()
        if str(e.tag).endswith("animateTransform") and e.get("type") == kind
    ]
    return sorted(found, key=lambda values: abs(values[0][0] - values[-1][0]), reverse=True)


def texts(figure):
    return ["".join(e.itertext()) for e in figure.iter() if str(e.tag).endswith("}text")]


def test_a_robot_drives_as_far_as_it_drove(trace):
    figure = drawn(trace, 10.0)
    (track,) = animated(figure, "translate")
    metre = 252.0 / 7.0  # 5 m of way and 1 m beside it at both ends fill the width
    assert track[-1][0] - track[0][0] == pytest.approx(10.0 * SPEED * metre, abs=1.0)
    assert {y for _, y in track} == {track[0][1]}


def test_a_door_swings_around_its_hinge_when_it_swung(trace):
    (turns,) = animated(drawn(trace, 10.0), "rotate")
    angles = [angle for (angle,) in turns]
    assert angles[-1] - angles[0] == pytest.approx(np.degrees(1.0), abs=0.2)
    # It begins at 9 s of what begins at 3 s, and takes a second.
    moving = [index for index in range(len(angles) - 1) if angles[index] != angles[index + 1]]
    assert moving[0] / 8.0 == pytest.approx(SHUTS - 3.0, abs=0.2)
    assert (moving[-1] - moving[0]) / 8.0 == pytest.approx(1.0, abs=0.2)


def test_what_does_not_move_is_not_animated(trace):
    assert animated(drawn(trace, 17.0), "rotate") == []


def test_a_contact_flashes_when_it_happened(trace):
    (circle, _) = [e for e in drawn(trace, 10.0).iter() if str(e.tag).endswith("circle")]
    (shown,) = list(circle)
    assert shown.get("values") == "hidden;visible;hidden"
    begins = float(str(shown.get("keyTimes")).split(";")[1])
    assert begins * 12.5 == pytest.approx(TOUCHES - 3.0, abs=0.2)
    ring = [e for e in drawn(trace, 17.0).iter() if str(e.tag).endswith("circle")]
    assert len(ring) == 1  # that of the moment alone


@pytest.mark.parametrize(
    ("time", "first", "last"), [(10.0, 3.0, 12.5), (0.0, 0.0, 10.0), (20.0, 10.0, 20.0)]
)
def test_ten_seconds_are_shown_also_at_the_ends_of_a_run(trace, time, first, last):
    shown = [float(text.removesuffix(" s")) for text in texts(drawn(trace, time)) if " s" in text]
    assert shown[0] == pytest.approx(first)
    assert max(shown) == pytest.approx(last, abs=0.51)
    # The last text is that of the still.
    assert shown[-1] == pytest.approx(time)


def test_the_same_run_gives_the_same_bytes_and_few_of_them(trace):
    once, again = (plot_recorded_moment(trace, 10.0, "") for _ in range(2))
    assert once is not None
    assert again is not None
    svg = once.svg("f0", "a moment")
    assert svg == again.svg("f0", "a moment")
    assert len(svg) < 20_000
    assert not re.search(r"<script|href=|url\((?!#)", svg)


def test_paper_and_who_wants_less_motion_see_the_moment():
    import templates.report

    css = (Path(templates.report.__file__).parent / "report.css").read_text("utf-8")
    screen = "@media screen and (prefers-reduced-motion: no-preference)"
    before, _, after = css.partition(screen)
    assert ".moving { display: none; }" in before
    assert after.lstrip(" {\n").startswith(".moving { display: inline; } .still { display: none; }")
