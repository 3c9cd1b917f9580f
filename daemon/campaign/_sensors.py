"""Robots and the systems they meet in a campaign: sensors that do not suit what listens to them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from daemon.model.attachments import resolve_paths
from daemon.model.spec import SutReference
from daemon.stacks.findings import ParameterFinding, format_path
from grammars.model.robot import Robot
from grammars.text.diagnostics import Diagnostic, Severity, Where


def check_sensors(pairs: Iterable[tuple[SutReference, Robot, Where]]) -> Iterator[Diagnostic]:
    """Yield what sensors of robots and the stacks that listen to them have against each other.

    ``pairs`` of a system and a robot come with the place of the scenario they meet in; what is
    said of a pair is said once.
    """
    once: dict[tuple[str, str], tuple[SutReference, Robot, Where]] = {}
    for sut, robot, where in pairs:
        once.setdefault((sut.name, robot.name), (sut, robot, where))
    for sut, robot, where in once.values():
        for found in _advice(sut, robot):
            place = f" {format_path(found.path)}" if sut.kind == "ros" else ""
            message = f"{sut.name}:{place} {found.message}"
            yield Diagnostic(where, message, found.hint, Severity.WARNING)


def _advice(sut: SutReference, robot: Robot) -> Iterator[ParameterFinding]:
    if sut.kind == "ros2":
        from daemon.stacks.ros2.advice import advise_for_robot
        from daemon.stacks.ros2.settings import read_settings

        yield from advise_for_robot(read_settings(resolve_paths(sut.parameters, sut.files)), robot)
    elif sut.kind == "ros":
        # Loads a compiler, which nobody needs who tests another stack.
        from daemon.stacks.ros1 import advice
        from daemon.stacks.ros1.configuration import read_ros

        yield from advice.advise_for_robot(read_ros(sut.parameters), robot)
