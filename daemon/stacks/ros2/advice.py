"""What can be run but will probably not do what its user wants: warnings about settings.

Measured with the eight lifecycle nodes of Nav2 (Jazzy) unless it says otherwise.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from daemon.model.attachments import FILES_PARAMETER
from daemon.stacks.findings import ParameterFinding, ParameterFindings
from daemon.stacks.ros2.placeholders import MAP, placeholders_in
from daemon.stacks.ros2.settings import Ros2Settings, texts_with_placeholders
from grammars.model.robot import Robot
from grammars.text.diagnostics import did_you_mean

_SHORTEST_START: Final = 15.0
"""[s] They were active 12.3 s after "ros2 launch" on an idle machine."""
_ROUNDING: Final = 1e-6


def check_settings(settings: Ros2Settings) -> ParameterFindings:
    """Return warnings about settings; starts nothing."""
    return ParameterFindings(tuple(_about_starting(settings)))


def advise_for_robot(settings: Ros2Settings, robot: Robot) -> Iterator[ParameterFinding]:
    """Yield what does not fit the robot: lasers it has not, samples that fit no cycles."""
    yield from _about_lasers(settings, robot)
    sensors = {laser.label: laser.rate for laser in robot.lasers}
    for name, rate in (sensors | {"odometry": robot.odometry.rate}).items():
        if rate <= 0.0:
            continue
        cycles = 1.0 / (rate * settings.period)
        if not (_is_whole(cycles) or _is_whole(1.0 / cycles)):
            message = (
                f"the {name} of robot {robot.name} has {rate:g} Hz, which is no whole number of "
                f"cycles of {settings.period:g} s: some cycles have a sample more than others"
            )
            hint = "set period to that of the stack's controller, or another rate of the robot"
            yield ParameterFinding(("period",), message, hint)


def _about_lasers(settings: Ros2Settings, robot: Robot) -> Iterator[ParameterFinding]:
    names = [laser.name for laser in robot.lasers]
    has = f"has lasers {', '.join(names)}" if names[0] else "has one laser, which has no name"
    for path, given in (
        (("topics", "scan"), settings.topics.scan),
        (("frames", "laser"), settings.frames.laser),
    ):
        for name in () if isinstance(given, str) else given:
            if name not in names:
                message = f'robot {robot.name} has no laser "{name}": it {has}'
                hint = did_you_mean(name, filter(None, names))
                yield ParameterFinding((*path, name), message, hint)


def _is_whole(ratio: float) -> bool:
    return round(ratio) >= 1 and abs(ratio - round(ratio)) <= _ROUNDING * ratio


def _about_starting(settings: Ros2Settings) -> Iterator[ParameterFinding]:
    used = {name for _, text in texts_with_placeholders(settings) for name in placeholders_in(text)}
    if settings.start_up < _SHORTEST_START:
        message = f"{settings.start_up:g} s: Nav2 needs 12 s on an idle machine"
        yield ParameterFinding(("start-up",), message, "leave it out for 60 s")
    if not settings.ready:
        message = (
            "ready names no nodes: the mission begins once its action is there and the scan is "
            "heard, whether or not the stack is active"
        )
        hint = "name the lifecycle nodes, such as [amcl, controller_server, bt_navigator]"
        yield ParameterFinding(("ready",), message, hint)
    if settings.map == "file" and MAP not in used:
        message = "nothing here says {map}, so the stack is not given the map of the run"
        hint = 'pass it on, such as map:={map}, or write "map: published"'
        yield ParameterFinding(("launch",), message, hint)
    for name in settings.files:
        if name not in used:
            message = f"nothing here says {{{name}}}, so the stack is not given this file"
            yield ParameterFinding((FILES_PARAMETER, name), message, "pass on where it is")
    if settings.environment.domain != "own":
        message = "runs that go on at once on one machine share this domain and hear each other"
        hint = "own gives each run a domain of its own"
        yield ParameterFinding(("environment", "ROS_DOMAIN_ID"), message, hint)
