"""Executes runs as always, those of other campaigns than the demo so slowly that one can watch."""

from __future__ import annotations

import itertools
import time
from pathlib import Path
from typing import Final, Literal

from daemon import run
from daemon.model.spec import RunResult, RunSpec
from daemon.run_judge import JudgementReceiver
from daemon.run_loop import WATCHED_RATE, Interest, ProgressCallback
from grammars.model.scene import Scene

EXECUTOR: Final = f"{__name__}:execute"
_QUICK: Final = "courier"
"""The mission of the demo."""
PACE: Final = 6.0
"""Simulated seconds in a second."""


def execute(
    spec: RunSpec,
    scene: Scene,
    *,
    trace_path: Path,
    on_progress: ProgressCallback | None = None,
    interest: Interest | None = None,
    leads: bool = False,
    judgements: JudgementReceiver | None = None,
) -> RunResult:
    """Do what :func:`daemon.run.execute` does."""
    if interest is not None and spec.mission.name != _QUICK:
        interest = _paced(interest)
    return run.execute(
        spec, scene, trace_path=trace_path, on_progress=on_progress, interest=interest,
        leads=leads, judgements=judgements,
    )  # fmt: skip


def _paced(interest: Interest) -> Interest:
    """Let time pass between two questions whether anybody is interested."""
    began, asked = time.monotonic(), itertools.count()

    def paced() -> Literal["nothing", "progress", "everything"]:
        due = began + next(asked) / (WATCHED_RATE * PACE)
        time.sleep(max(due - time.monotonic(), 0.0))
        return interest()

    return paced
