"""Executes runs as always, those of other campaigns than the demo so slowly that one can watch."""

import itertools
import time

from daemon import run
from daemon.run_loop import WATCHED_RATE

EXECUTOR = f"{__name__}:execute"
_QUICK = "courier"
"""The mission of the demo."""
PACE = 6.0
"""Simulated seconds in a second."""


def execute(
    spec, scene, *, trace_path, on_progress=None, interest=None, leads=False, judgements=None
):
    """Do what :func:`daemon.run.execute` does."""
    if interest is not None and spec.mission.name != _QUICK:
        interest = _paced(interest)
    return run.execute(
        spec, scene, trace_path=trace_path, on_progress=on_progress, interest=interest,
        leads=leads, judgements=judgements,
    )  # fmt: skip


def _paced(interest):
    """Let time pass between two questions whether anybody is interested."""
    began, asked = time.monotonic(), itertools.count()

    def paced():
        due = began + next(asked) / (WATCHED_RATE * PACE)
        time.sleep(max(due - time.monotonic(), 0.0))
        return interest()

    return paced
