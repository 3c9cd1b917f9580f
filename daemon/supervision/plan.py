"""What a supervisor is told to start, and the names of what lies in a stack's folder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

PROGRAM: Final = (
    "import sys; sys.path.append(sys.argv[1]);from supervision.supervisor import main; main()"
)
"""What a supervisor executes, and what it is known by: without our packages."""
STACK_OUTPUT: Final = "stack.output"
RELAY_OUTPUT: Final = "relay.output"
ENVIRONMENT: Final = "environment"
"""What the setup command leaves: the environment of the stack, entries ended by a NUL."""
RELAY_EXIT: Final = "relay.exit"
"""Written by the script in a container: the exit code of the relay there."""
ALARM: Final = "scenario: "
"""What our own shell scripts say on standard error begins with it."""


@dataclass(frozen=True)
class StackPlan:
    """What to start, and when to end it.

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
