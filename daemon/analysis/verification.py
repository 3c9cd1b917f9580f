"""Repeated execution of a recorded specification: equal bytes, or the spread of outcomes.

A trace contains its specification and its scene. Systems under test inside the simulation leave
the same bytes; for external ones only the spread can be measured.
"""

from __future__ import annotations

import os
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import computed_field

from daemon.analysis.child_runs import ExecuteRun, run_in_children, trace_in
from daemon.batch.paths import StatePaths
from daemon.batch.stores import file_sha256
from daemon.judging import oracles
from daemon.model.attachments import FILES_VARIABLE, user_files_folder
from daemon.model.spec import ENGINE_VERSION, RunResult, RunSpec, package_versions
from daemon.model.verdicts import Outcome, Verdict
from daemon.run import execute
from daemon.trace import Trace, TraceDifference, TraceError, first_difference, read_trace
from grammars.model.scene import Scene

DURATION: Final = "duration"
PATH: Final = "path driven"


@dataclass(frozen=True, slots=True)
class ExecutedRun:
    """An execution: its outcome, the SHA-256 of its trace, and measured values.

    ``values`` are by name: the simulated duration [s], the true path [m], the margin of each oracle
    and the value of each measure, in the units of :attr:`Verification.units`. ``difference`` is
    the first difference from the recorded trace. ``problem`` says why the rest is empty.
    """

    outcome: Outcome = Outcome.ERROR
    ended: str = ""
    note: str = ""
    sha256: str = ""
    values: Mapping[str, float] = field(default_factory=dict)
    problem: str = ""
    difference: TraceDifference | None = None


@dataclass(frozen=True, slots=True)
class Spread:
    """The least and the greatest value over ``count`` executions, in ``unit``."""

    name: str
    unit: str
    least: float
    most: float
    count: int


@dataclass(frozen=True, slots=True)
class Verification:
    """A recorded run and executions of its specification.

    Without a ``trace`` the recording is the first execution. ``versions`` are those of packages
    that have changed since the recording: (then, now) by name.
    """

    trace: str
    run: str
    sut: str
    digest: str
    repeatable: bool
    recorded: ExecutedRun
    executions: tuple[ExecutedRun, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    versions: Mapping[str, tuple[str, str]] = field(default_factory=dict)

    @property
    def all_executed(self) -> bool:
        """``True`` if every execution left a trace."""
        return not any(one.problem for one in (self.recorded, *self.executions))

    @computed_field  # type: ignore[prop-decorator]
    @property
    def same_bytes(self) -> int:
        """Number of executions with the bytes of the recording."""
        return sum(execution.sha256 == self.recorded.sha256 for execution in self.executions)

    @computed_field  # type: ignore[prop-decorator]
    @property
    def nondeterministic(self) -> bool:
        """``True`` if executions here of a repeatable system left different bytes.

        A recording may come from other code, packages or another machine.
        """
        here = self.executions if self.trace else (self.recorded, *self.executions)
        return self.repeatable and len({one.sha256 for one in here if not one.problem}) > 1

    @computed_field  # type: ignore[prop-decorator]
    @property
    def first_difference(self) -> TraceDifference | None:
        """The earliest difference of an execution from the recording."""
        places = [one.difference for one in self.executions if one.difference is not None]
        return min(places, key=lambda one: (not one.topic, one.time), default=None)

    @computed_field  # type: ignore[prop-decorator]
    @property
    def outcomes(self) -> dict[str, int]:
        """Number of executions by outcome, the recording included."""
        counts = Counter(str(one.outcome) for one in self._traces)
        return {word: counts[word] for word in Outcome if counts[word]}

    @computed_field  # type: ignore[prop-decorator]
    @property
    def spreads(self) -> tuple[Spread, ...]:
        """Spread of each value, the recording included."""
        spreads = []
        for name, unit in self.units.items():
            values = [one.values[name] for one in self._traces if name in one.values]
            if values:
                spreads.append(Spread(name, unit, min(values), max(values), len(values)))
        return tuple(spreads)

    @property
    def _traces(self) -> tuple[ExecutedRun, ...]:
        return tuple(one for one in (self.recorded, *self.executions) if not one.problem)


@dataclass(frozen=True, slots=True)
class Verifications:
    """Runs and executions of their specifications, in the order of the command line."""

    runs: tuple[Verification, ...]


def verify(
    path: Path,
    repeats: int,
    *,
    places: StatePaths,
    wall: float = 0.0,
    advance: Callable[[], None] = lambda: None,
) -> Verification:
    """Execute the specification in the trace at ``path`` again, ``repeats`` times one by one.

    Each has a process of its own and at most ``wall`` seconds of wall clock (0: the usual limit).
    ``advance`` is called after each. Files of a system under test come from this user, otherwise
    from the state directory ``places``. Raises :class:`~daemon.trace.TraceError` for a trace that
    is unreadable or was made by another engine.
    """
    trace = read_trace(path)
    spec = trace.spec
    if spec.engine != ENGINE_VERSION:
        message = f"is of engine {spec.engine}, this is engine {ENGINE_VERSION}"
        hint = "install the version that recorded it, or run its campaign again"
        raise TraceError(path, message, hint)
    oracles.warm_up()
    verdicts = oracles.judge(trace, spec.oracles)
    units = {DURATION: "s", PATH: "m", **{one.oracle: one.unit for one in verdicts}}
    executions = []
    for one in _executions(path, trace, repeats, wall, _with_files(spec, places)):
        executions.append(one)
        advance()
    now = package_versions()
    return replace(
        _unverified(spec, _measure(trace, verdicts)),
        trace=str(path),
        executions=tuple(executions),
        units=units,
        versions={
            name: (then, now[name])
            for name, then in trace.versions.items()
            if now.get(name, then) != then
        },
    )


def verify_spec(
    spec: RunSpec,
    scene: Scene,
    repeats: int,
    *,
    places: StatePaths,
    wall: float = 0.0,
    advance: Callable[[], None] = lambda: None,
) -> Verification:
    """Execute a specification ``repeats`` times; the first execution serves as the recording.

    Otherwise as :func:`verify`. If the first execution leaves no trace, there are no others.
    """
    with tempfile.TemporaryDirectory(prefix="scenario-verify-") as name:
        run = _with_files(spec, places)
        (first,) = run_in_children([(spec, scene)], Path(name), wall=wall, execute_run=run)
        advance()
        if first.result is None:
            return _unverified(spec, ExecutedRun(problem=first.problem))
        trace = trace_in(Path(name), 0)
        again = verify(trace, repeats - 1, places=places, wall=wall, advance=advance)
        return replace(again, trace="")


def _unverified(spec: RunSpec, recorded: ExecutedRun) -> Verification:
    repeatable = spec.sut.repeatable
    return Verification("", spec.label, spec.sut.name, spec.digest, repeatable, recorded)


def _executions(
    recording: Path, trace: Trace, repeats: int, wall: float, execute_run: ExecuteRun
) -> Iterator[ExecutedRun]:
    run = (trace.spec, trace.scene)
    for _ in range(repeats):
        with tempfile.TemporaryDirectory(prefix="scenario-verify-") as name:
            (ended,) = run_in_children([run], Path(name), wall=wall, execute_run=execute_run)
            if ended.result is None:
                yield ExecutedRun(problem=ended.problem)
                continue
            path = trace_in(Path(name), 0)
            execution = _measure(read_trace(path), ended.result.verdicts)
            yield replace(execution, difference=first_difference(recording, path))


def _measure(trace: Trace, verdicts: Sequence[Verdict]) -> ExecutedRun:
    """Return the values of a trace and of its verdicts."""
    truth = trace.ground_truth
    way = float(np.hypot(np.diff(truth.x), np.diff(truth.y)).sum())
    values = {DURATION: trace.valid_until, PATH: way}
    for verdict in verdicts:
        is_measure = verdict.outcome is Outcome.MEASURE
        value = verdict.evidence.value if is_measure else verdict.margin
        if value is not None and np.isfinite(value):
            values[verdict.oracle] = value
    outcome = oracles.overall_outcome(trace, verdicts)
    return ExecutedRun(outcome, trace.ended or "", trace.note, file_sha256(trace.path), values)


def _with_files(spec: RunSpec, places: StatePaths) -> ExecuteRun:
    """Return an executor that finds files of the run in ``places`` if this user has none."""
    if all((user_files_folder() / digest).is_file() for digest in spec.files):
        return execute
    if not all((places.files / digest).is_file() for digest in spec.files):
        return execute

    def execute_with_files(*arguments: Any, **rest: Any) -> RunResult:
        os.environ[FILES_VARIABLE] = str(places.files)  # in the child alone
        return execute(*arguments, **rest)

    return execute_with_files
