"""Plan for a supervisor, and the names of files in a stack's folder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

PROGRAM: Final = (
    "import sys; sys.path.append(sys.argv[1]);from supervision.supervisor import main; main()"
)
"""Program of a supervisor, without our packages; it also identifies supervisors in /proc."""
STACK_OUTPUT: Final = "stack.output"
RELAY_OUTPUT: Final = "relay.output"
ENVIRONMENT: Final = "environment"
"""Environment of the stack as the setup command writes it, entries ended by a NUL."""
RELAY_EXIT: Final = "relay.exit"
"""Exit code of the relay in a container, as the script there writes it."""
ALARM: Final = "scenario: "
"""Prefix of the errors of our own shell scripts."""


@dataclass(frozen=True)
class StackPlan:
    """Commands of a stack, and its time limits.

    ``setup`` is a command that writes the environment of the stack to :data:`ENVIRONMENT`, or
    empty. ``stack`` and ``relay`` are commands whose programs are searched in that environment;
    ``relay_variables`` are for the relay alone. ``domain`` is the stack's. Lines of the stack's
    output that contain one of ``alarms`` are reported. ``engine`` and ``name`` describe a
    container. The stack ends with the process ``holder``. ``grace`` [s] follows each of SIGINT and
    SIGTERM; ``setup_limit`` [s] is for the setup files.
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
