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
_LONGEST_PATIENCE: Final = 10.0
"""[s] A stack that hangs costs this in each cycle until too many are late."""
_ROUNDING: Final = 1e-6


def check_settings(settings: Ros2Settings) -> ParameterFindings:
    """Return warnings about settings; starts nothing."""
    return ParameterFindings((*_about_waiting(settings), *_about_starting(settings)))


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
        (("topics", "scan"), settings.topics.scans),
        (("frames", "laser"), settings.frames.lasers),
    ):
        for name in given:
            if name not in names:
                message = f'robot {robot.name} has no laser "{name}": it {has}'
                hint = did_you_mean(name, filter(None, names))
                yield ParameterFinding((*path, name), message, hint)


def _is_whole(ratio: float) -> bool:
    return round(ratio) >= 1 and abs(ratio - round(ratio)) <= _ROUNDING * ratio


def _about_waiting(settings: Ros2Settings) -> Iterator[ParameterFinding]:
    if settings.patience <= settings.period:
        message = (
            f"{settings.patience:g} s is not more than a cycle of {settings.period:g} s: "
            "a controller that runs on wall time, as Nav2's does, is late in every one"
        )
        yield ParameterFinding(("patience",), message, "leave it out for 1 s")
    elif settings.patience > _LONGEST_PATIENCE:
        message = f"a stack that hangs costs {settings.patience:g} s of wall time in each cycle"
        yield ParameterFinding(("patience",), message, "leave it out for 1 s")
    if settings.tolerance >= settings.period:
        message = "takes the command of the cycle before for the answer of this one"
        yield ParameterFinding(("tolerance",), message, f"less than {settings.period:g} s")
    if settings.idle > settings.patience:
        message = "is more than patience: cycles in which nothing is expected last the longest"
        yield ParameterFinding(("idle",), message, "leave it out for 0.02 s")
    if settings.late >= 1.0:
        message = "no run is ever an error, also not of a stack that never answers"
        yield ParameterFinding(("late",), message, "leave it out for 5 %")


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
    if settings.domain is not None:
        message = "runs that go on at once on one machine share this domain and hear each other"
        hint = "own gives each run a domain of its own"
        yield ParameterFinding(("environment", "ROS_DOMAIN_ID"), message, hint)
