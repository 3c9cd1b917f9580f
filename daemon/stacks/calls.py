"""Calls of a system under test: every failure in it becomes a :class:`SutError`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Final

import numpy as np

from daemon.model.deadline import OutOfTime, interruptible, wall_clock_limit
from daemon.model.sut import Decision, SutFailure, SystemUnderTest
from daemon.stacks.registry import make_sut
from grammars.model.geometry import Floats, Pose2

_MAKING_LIMIT: Final = 60.0
"""Wall clock for making the system under test of a run [s]. Longer than the limit of a check,
because the machine may be full of runs."""


class SutError(Exception):
    """A failure of the system under test; ``note`` describes it for the result and the trace.

    ``events`` are the system's last messages. ``stopped``: the wall clock ended it.
    """

    def __init__(self, error: BaseException) -> None:
        # The innermost frame is the place in the system under test. ``grammars.text.plugins``
        # words this differently, but recorded traces contain the sentence below.
        where = error.__traceback__
        while where is not None and where.tb_next is not None:
            where = where.tb_next
        place = (
            f" ({Path(where.tb_frame.f_code.co_filename).name}:{where.tb_lineno})" if where else ""
        )
        self.stopped = isinstance(error, OutOfTime)
        self.events = error.events if isinstance(error, SutFailure) else ()
        self.note = f"the system under test crashed: {type(error).__name__}: {error}{place}"
        if self.stopped or isinstance(error, SutFailure):
            self.note = str(error)
        # The message may quote a program's output, which need not be valid text.
        self.note = self.note.encode("utf-8", "backslashreplace").decode()
        super().__init__(self.note)


class sut_call:  # noqa: N801  (used like a function)
    """Context of calls of a system under test, which turns its failures into :class:`SutError`.

    A failure is any exception, leaving the interpreter, or exceeding the wall clock limit of
    :mod:`daemon.model.deadline`. Messages call it ``name``. One instance serves many calls.
    """

    __slots__ = ("_call",)

    def __init__(self, name: str) -> None:
        self._call = interruptible(name)

    def __enter__(self) -> None:
        try:
            self._call.__enter__()
        except OutOfTime as error:
            raise SutError(error) from error

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            self._call.__exit__()
        except OutOfTime as late:
            error = error or late
        if isinstance(error, Exception | SystemExit | OutOfTime):
            raise SutError(error) from error


def make_in_time(kind: str, parameters: Mapping[str, Any]) -> SystemUnderTest:
    """Make a system under test.

    Raises ``ValueError`` as :func:`daemon.stacks.registry.make_sut` does, and :class:`SutError`
    for a system that is not made in time. The trace of the run then contains the reason.
    """
    try:
        with wall_clock_limit(_MAKING_LIMIT), interruptible("its factory"):
            return make_sut(kind, parameters)
    except OutOfTime as error:
        raise SutError(error) from error


def check_decision(decision: object) -> None:
    """Raise ``TypeError`` for anything but a decision, ``ValueError`` for numbers not finite."""
    if not isinstance(decision, Decision):
        raise TypeError(f"update() must return a Decision, not {type(decision).__name__}")
    if decision.estimate is not None:
        pose, covariance = decision.estimate.pose, decision.estimate.covariance
        _check_finite("estimate", pose, covariance)
    if decision.cloud is not None:
        _check_finite("particle cloud", decision.cloud.mean, decision.cloud.covariance)


def _check_finite(what: str, pose: Pose2, covariance: Floats) -> None:
    if not (math.isfinite(pose.x + pose.y + pose.yaw) and math.isfinite(float(np.sum(covariance)))):
        raise ValueError(f"its {what} has values that are not finite")
