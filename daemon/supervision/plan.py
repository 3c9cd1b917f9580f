"""The plan that a supervisor executes, and the names of files in a stack's folder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

PROGRAM: Final = (
    "import sys; sys.path.append(sys.argv[1]);from supervision.supervisor import main; main()"
)
"""Program of a supervisor, without our packages; processes are recognised by it."""
STACK_OUTPUT: Final = "stack.output"
RELAY_OUTPUT: Final = "relay.output"
ENVIRONMENT: Final = "environment"
"""Environment of the stack as the setup command writes it, entries ended by a NUL."""
RELAY_EXIT: Final = "relay.exit"
"""Written by the script in a container: the exit code of the relay there."""
ALARM: Final = "scenario: "
"""Prefix of the errors of our own shell scripts."""


@dataclass(frozen=True)
class StackPlan:
    """Commands of a stack, and the times until it is ended.

    ``setup`` is a command that writes the environment of the stack to :data:`ENVIRONMENT`, or
    empty; ``stack`` and ``relay`` are commands, their programs looked for in that environment,
    ``relay_variables`` for the relay alone, ``domain`` the stack's. Lines of the stack's output
    that contain one of ``alarms`` are reported. ``engine`` and ``name`` are those of a container.
    ``holder`` is the process that the stack does not outlive. ``grace`` [s] is waited after each of
    SIGINT and SIGTERM, ``setup_limit`` [s] for the setup files.
    """

    token: str
    folder: str
    domain: int
    setup: list[str]
    stack: list[str]
    relay: list[str]
    relay_variables: dict[str, str]
    alarms: list[str]
    engine: str
    name: str
    holder: int
    grace: float
    setup_limit: float
