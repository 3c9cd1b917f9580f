"""Systems under test outside of the simulation: how often they are run, what does not suit them.

Same specification, same world and noise, but not the same answers: one run of such a system shows
less than one of a system that repeats itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

from daemon.model.spec import SutReference
from daemon.stacks.ros2.advice import advise_for_robot
from daemon.stacks.ros2.settings import read_settings
from grammars.model.robot import Robot
from grammars.text.diagnostics import Diagnostic, Severity, Where
from grammars.text.documents import YamlDocument

EXTERNAL_REPEATS: Final = 5
"""Runs of a cell whose system is not repeatable, where a campaign does not say how many. As many as
the published evaluation of the reference stack has; five of five that pass show at least 55 %."""


def says_repeats(document: YamlDocument) -> bool:
    """Whether a campaign file says how often its cells are run."""
    return "repeats" in document.data


def default_repeats(suts: Iterable[SutReference]) -> int:
    """Return how often a cell of any of these is run when nobody said it."""
    return max((1 if sut.repeatable else EXTERNAL_REPEATS for sut in suts), default=1)


def announce_repeats(
    suts: Iterable[SutReference], document: YamlDocument
) -> tuple[Diagnostic, ...]:
    """Say how often cells are run whose system is not repeatable, where nobody said it."""
    names = dict.fromkeys(sut.name for sut in suts if not sut.repeatable)
    if not names or says_repeats(document):
        return ()
    message = (
        f"{', '.join(names)}: not repeatable, so every scenario is run {EXTERNAL_REPEATS} times "
        "with it; the campaign does not say how often"
    )
    where = document.where(("matrix", "sut"))
    hint = f'write "repeats: {EXTERNAL_REPEATS}" for all systems, or another number'
    return (Diagnostic(where, message, hint, Severity.WARNING),)


def check_sensors(pairs: Iterable[tuple[SutReference, Robot, Where]]) -> Iterator[Diagnostic]:
    """Yield sensors of robots whose samples do not fit the cycles of a ROS 2 stack.

    ``pairs`` of a system and a robot come with the place of the scenario they meet in; what is
    said of a pair is said once.
    """
    once: dict[tuple[str, str], tuple[SutReference, Robot, Where]] = {}
    for sut, robot, where in pairs:
        if sut.kind == "ros2":
            once.setdefault((sut.name, robot.name), (sut, robot, where))
    for sut, robot, where in once.values():
        for found in advise_for_robot(read_settings(sut.parameters), robot):
            yield Diagnostic(where, f"{sut.name}: {found.message}", found.hint, Severity.WARNING)
