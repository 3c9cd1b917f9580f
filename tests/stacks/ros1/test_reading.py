"""One section of ROS parameters: what is taken, what is refused, what is only said."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Annotated, ClassVar, Literal

import pytest
from pydantic import Field
from pydantic.dataclasses import dataclass

from daemon.stacks.findings import FindingCollector, ParameterError
from daemon.stacks.ros1.parameters import Objection, Section, read_section
from daemon.stacks.ros1.quirks import FAST, FIXED, read_quirks


@dataclass(frozen=True, slots=True)
class Model(Section):
    radius: Annotated[float, Field(gt=0.0, le=10.0)] = 0.5
    samples: Annotated[int, Field(ge=1)] = 3
    active: bool = True
    kind: Literal["diff", "omni"] = "diff"
    corners: tuple[tuple[float, float], ...] = ()
    low: float = 0.0

    renamed: ClassVar = {"rad": "radius", "speed": "velocity"}
    without_effect: ClassVar = {"velocity": "nothing moves"}

    def rules(self):
        if self.low > self.radius:
            yield Objection(("radius", "low"), f"low {self.low} is above radius {self.radius}")
        if self.low == self.radius:
            yield Objection(("radius", "low"), "low is radius", fatal=False)


class Strict(Model):
    strict = True


def read(given, model=Model, **options):
    report = FindingCollector()
    return read_section(model, given, ("ns",), report, **options), report


def fatal(given):
    _, report = read(given)
    with pytest.raises(ParameterError) as caught:
        report.findings()
    return str(caught.value)


def test_what_is_given_is_taken_and_the_rest_has_defaults():
    model, report = read({"radius": 2, "samples": 4.0, "corners": [[1, 2], [3.5, 4]]})
    assert model == Model(radius=2.0, samples=4, corners=((1.0, 2.0), (3.5, 4.0)))
    assert report.findings().problems == ()


def test_every_error_is_reported_at_once():
    text = fatal({"radius": -1.0, "samples": 0, "active": 3})
    assert all(f"ns/{name}" in text for name in ("radius", "samples", "active"))
    assert fatal({"active": 1}) == "ns/active: must be true or false (given: 1)"
    assert fatal({"active": "yes"}) == "ns/active: must be true or false (given: 'yes')"


def test_rules_are_about_the_first_name_that_is_given():
    assert fatal({"low": 5.0}) == "ns/low: low 5.0 is above radius 0.5"
    assert fatal({"low": 5.0, "radius": 1}) == "ns/radius: low 5.0 is above radius 1.0"


def test_a_default_in_the_place_of_a_bad_value_contradicts_nothing():
    assert fatal({"radius": -1.0, "low": 5.0}) == "ns/radius: must be greater than 0 (given: -1)"


def test_a_doubt_is_a_warning_at_the_first_name_that_somebody_wrote():
    _, report = read({"low": 0.5}, places={"low": ("elsewhere", "below")})
    assert [str(each) for each in report.findings().problems] == ["elsewhere/below: low is radius"]
    _, report = read({}, inherited={"low": 0.5})
    assert [str(each) for each in report.findings().problems] == ["ns: low is radius"]


def test_a_name_of_older_releases_is_said_with_that_of_noetic():
    _, report = read({"rad": 1.0, "speed": 1.0})
    assert [str(each) for each in report.findings().problems] == [
        "ns/rad: ROS Noetic calls it radius and ignores rad: radius has its default; write radius"
    ]
    assert [str(each) for each in report.findings().without_effect] == [
        "ns/speed: ROS Noetic calls it velocity and ignores speed; nothing moves"
    ]


def test_an_unknown_name_is_a_warning_with_what_was_probably_meant():
    _, report = read({"raduis": 1.0})
    (finding,) = report.findings().problems
    assert finding.path == ("ns", "raduis")
    assert finding.hint == 'did you mean "radius"?'


def test_a_name_without_effect_is_listed_with_the_reason_and_no_problem():
    _, report = read({"low": 0.1, "viz": True}, without_effect={"low": "unused", "viz": "drawn"})
    findings = report.findings()
    assert findings.problems == ()
    assert [str(f) for f in findings.without_effect] == ["ns/low: unused", "ns/viz: drawn"]


def test_in_a_section_that_no_ros_node_reads_an_unknown_name_is_an_error():
    _, report = read({"raduis": 1.0}, Strict)
    with pytest.raises(ParameterError, match="raduis"):
        report.findings()


def test_quirks_are_a_profile_or_one_with_switches_turned():
    report = FindingCollector()
    assert read_quirks("fixed", ("quirks",), report) == FIXED
    mixed = read_quirks({"like": "fixed", "strafe_leaks": True}, ("quirks",), report)
    assert mixed.strafe_leaks
    assert not mixed.perimeter_only
    assert read_quirks({}, ("quirks",), report) == FAST
    assert read_quirks("fast", ("quirks",), report) == FAST
    assert report.fatal == []


def test_the_profile_of_the_original_has_all_its_oddities():
    report = FindingCollector()
    original = read_quirks("original", ("quirks",), report)
    assert all(asdict(original).values())
    assert replace(original, inflation_queue_order=False) == FAST


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("fixd", 'did you mean "fixed"?'),
        ({"strafe_leak": False}, 'did you mean "strafe_leaks"?'),
        ({"strafe_leaks": 0}, "must be true or false"),
        (3, "must be fast, original, fixed"),
    ],
)
def test_wrong_quirks_are_errors(given, message):
    report = FindingCollector()
    read_quirks(given, ("quirks",), report)
    assert message in str(ParameterError(report.fatal))
