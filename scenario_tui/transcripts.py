"""What a ``scenario`` command of this installation answers, asked in a process of its own.

Judging and reports read every trace, by several processes and with much memory; the dashboard
shall stay small, and must not be forked: its threads would be missing in the child.
"""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from daemon.errors import DaemonError
from scenario_tui.equivalent import process, typed

Answer: TypeAlias = Mapping[str, Any]
Ask: TypeAlias = Callable[[tuple[str, ...]], Answer]
"""Runs ``scenario`` with arguments and ``--json``; returns the object it wrote."""


def ask(arguments: tuple[str, ...]) -> Answer:
    """Run a command and return what it wrote.

    It goes on when the dashboard is left. Raises :class:`daemon.errors.DaemonError` with its last
    words when it wrote nothing usable.
    """
    done = subprocess.run(
        process((*arguments, "--json")),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        start_new_session=True,
        env=os.environ | {"COLUMNS": "160", "TERM": "dumb"},
    )
    try:
        answer: Answer = json.loads(done.stdout)
    except ValueError as error:
        said = [line for line in done.stderr.splitlines() if line.strip()]
        last = said[-1] if said else f"it left with code {done.returncode}"
        message = f"{typed(arguments)}: {last.removeprefix('scenario: ')}"
        raise DaemonError(message) from error
    return answer
