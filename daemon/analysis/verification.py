"""Running a recorded specification again: the same bytes, or how far the outcomes spread.

A trace holds its specification and its scene, so nothing else is needed. Systems under test that
live in the simulation leave the same bytes; of those outside only the spread can be told.
"""

from __future__ import annotations

import multiprocessing
import os
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from daemon.analysis.forked_child import prepare_child
from daemon.batch.paths import StatePaths
from daemon.batch.stores import file_sha256
from daemon.judging import oracles
from daemon.model.attachments import FILES_VARIABLE, user_files_folder
from daemon.model.deadline import spare_time, stopped_after, wall_clock_limit
from daemon.model.execution import RunLimits
from daemon.model.spec import ENGINE_VERSION, RunResult, RunSpec, package_versions
from daemon.model.verdicts import Outcome, Verdict
from daemon.run import execute, load_kernels
from daemon.supervision.guardian import end_guarded
from daemon.trace import Trace, TraceDifference, TraceError, first_difference, read_trace
from grammars.model.scene import Scene
from grammars.text import codec
from grammars.text.files import write_atomically

_TRACE: Final = "trace.mcap"
_EXECUTION: Final = "execution.json"
DURATION: Final = "duration"
PATH: Final = "path driven"


@dataclass(frozen=True, slots=True)
class ExecutedRun:
    """What one execution left: outcome, SHA-256 of its trace, and what was measured.

    ``values`` are by name: the simulated duration [s], the true path [m], the margin of each oracle
    and the value of each measure, in the units of :attr:`Verification.units`. ``difference`` is
    where its trace parts from the recorded one. ``problem`` says why there is nothing else.
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
    """The least and the most of a value over ``count`` executions, in ``unit``."""

    name: str
    unit: str
    least: float
    most: float
    count: int


@dataclass(frozen=True, slots=True)
class Verification:
    """A recorded run and executions of its specification.

    ``versions`` are of packages that differ from those of the recording: (then, now) by name.
    """

    trace: str
    run: str
    sut: str
    digest: str
    repeatable: bool
    recorded: ExecutedRun
    executions: tuple[ExecutedRun, ...]
    units: Mapping[str, str]
    versions: Mapping[str, tuple[str, str]]

    @property
    def all_executed(self) -> bool:
        """Whether every execution left a trace."""
        return not any(one.problem for one in (self.recorded, *self.executions))

    @property
    def same_bytes(self) -> int:
        """How many executions left the bytes of the recording."""
        return sum(execution.sha256 == self.recorded.sha256 for execution in self.executions)

    @property
    def nondeterministic(self) -> bool:
        """Whether executions here, of one code on one machine, left different bytes."""
        return len({one.sha256 for one in self.executions if not one.problem}) > 1

    @property
    def first_difference(self) -> TraceDifference | None:
        """The earliest place where an execution parts from the recording."""
        found = [one.difference for one in self.executions if one.difference is not None]
        return min(found, key=lambda one: (not one.topic, one.time), default=None)

    @property
    def outcomes(self) -> dict[str, int]:
        """How often each outcome came out, the recording included."""
        counts = Counter(str(one.outcome) for one in self._traces)
        return {word: counts[word] for word in Outcome if counts[word]}

    @property
    def spreads(self) -> tuple[Spread, ...]:
        """How far each value spreads, the recording included."""
        found = []
        for name, unit in self.units.items():
            values = [one.values[name] for one in self._traces if name in one.values]
            if values:
                found.append(Spread(name, unit, min(values), max(values), len(values)))
        return tuple(found)

    @property
    def _traces(self) -> tuple[ExecutedRun, ...]:
        return tuple(one for one in (self.recorded, *self.executions) if not one.problem)


ExecuteRun: TypeAlias = Callable[..., RunResult]
WatchExecutions: TypeAlias = Callable[[Iterator[ExecutedRun], int], Sequence[ExecutedRun]]


def verify(
    path: Path,
    repeats: int,
    *,
    places: StatePaths,
    wall: float = 0.0,
    execute_run: ExecuteRun = execute,
    watch: WatchExecutions | None = None,
) -> Verification:
    """Execute the specification in the trace at ``path`` again, ``repeats`` times one by one.

    Each in a process of its own, for ``wall`` seconds of wall clock at most (0: as always).
    ``watch`` gets the executions as they come and returns them all. Files of a system under test
    are those of this user, else of the state directory ``places``.
    Raises :class:`~daemon.trace.TraceError` for a trace that cannot be read or was made by another
    engine.
    """
    trace = read_trace(path)
    spec = trace.spec
    if spec.engine != ENGINE_VERSION:
        message = f"is of engine {spec.engine}, this is engine {ENGINE_VERSION}"
        hint = "install the version that recorded it, or run its campaign again"
        raise TraceError(path, message, hint)
    oracles.warm_up()
    recorded, units = _measure(trace)
    load_kernels(spec, trace.scene)
    task = _Task(spec, trace.scene, wall, _files_folder(spec, places), execute_run, path)
    found = _executions(task, repeats)
    executions = tuple(found) if watch is None else tuple(watch(found, repeats))
    now = package_versions()
    return Verification(
        trace=str(path),
        run=spec.label,
        sut=spec.sut.name,
        digest=spec.digest,
        repeatable=spec.sut.repeatable,
        recorded=recorded,
        executions=executions,
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
    execute_run: ExecuteRun = execute,
) -> Verification:
    """Execute a specification nobody has recorded, ``repeats`` times; the first is the recording.

    Otherwise as :func:`verify`. A first execution that leaves no trace is the only one. With one
    of ``repeats`` there are no executions beside the recording.
    """
    load_kernels(spec, scene)
    task = _Task(spec, scene, wall, _files_folder(spec, places), execute_run)
    with tempfile.TemporaryDirectory(prefix="scenario-verify-") as name:
        first = _execute_in_child(task, Path(name))
        if repeats > 1 and not first.problem:
            found = verify(
                Path(name) / _TRACE,
                repeats - 1,
                places=places,
                wall=wall,
                execute_run=execute_run,
            )
            return replace(found, trace="")
    return Verification(
        trace="",
        run=spec.label,
        sut=spec.sut.name,
        digest=spec.digest,
        repeatable=spec.sut.repeatable,
        recorded=first,
        executions=(),
        units={},
        versions={},
    )


def _measure(trace: Trace) -> tuple[ExecutedRun, dict[str, str]]:
    """Return what a trace says, and the units of its values."""
    verdicts = oracles.judge(trace, trace.spec.oracles)
    values = {DURATION: trace.valid_until, PATH: _path_length(trace)}
    units = {DURATION: "s", PATH: "m"}
    for verdict in verdicts:
        units[verdict.oracle] = verdict.unit
        value = _value(verdict)
        if value is not None:
            values[verdict.oracle] = value
    outcome = oracles.overall_outcome(trace, verdicts)
    sha256 = file_sha256(trace.path)
    return ExecutedRun(outcome, trace.ended or "", trace.note, sha256, values), units


def _value(verdict: Verdict) -> float | None:
    measure = verdict.outcome is Outcome.MEASURE
    value = verdict.evidence.value if measure else verdict.margin
    return value if value is not None and np.isfinite(value) else None


def _path_length(trace: Trace) -> float:
    x, y = trace.ground_truth.x, trace.ground_truth.y
    return float(np.hypot(np.diff(x), np.diff(y)).sum())


def _files_folder(spec: RunSpec, places: StatePaths) -> Path | None:
    """Return where the files of the run are when this user has not got them."""
    digests = spec.files
    if all((user_files_folder() / digest).is_file() for digest in digests):
        return None
    return places.files if all((places.files / digest).is_file() for digest in digests) else None


@dataclass(frozen=True, slots=True)
class _Task:
    """What a child executes, and the trace that its own is held against, if there is one."""

    spec: RunSpec
    scene: Scene
    wall: float
    files: Path | None
    execute_run: ExecuteRun
    against: Path | None = None

    @property
    def limit(self) -> float:
        """Wall clock limit [s]."""
        return self.wall or RunLimits().wall_of(self.spec.limit)


def _executions(task: _Task, repeats: int) -> Iterator[ExecutedRun]:
    for _ in range(repeats):
        with tempfile.TemporaryDirectory(prefix="scenario-verify-") as name:
            yield _execute_in_child(task, Path(name))


def _execute_in_child(task: _Task, folder: Path) -> ExecutedRun:
    process = multiprocessing.get_context("fork").Process(
        target=_execute, args=(task, folder), daemon=True
    )
    process.start()
    try:
        process.join(task.limit + spare_time(task.limit))
        late = process.is_alive()
    finally:
        end_guarded(process)
    file = folder / _EXECUTION
    if file.is_file():
        return codec.from_json(ExecutedRun, file.read_bytes())
    if late:
        return ExecutedRun(problem=stopped_after(task.limit))
    return ExecutedRun(problem=f"its process died with code {process.exitcode}")


def _execute(task: _Task, folder: Path) -> None:
    prepare_child()
    if task.files is not None:
        os.environ[FILES_VARIABLE] = str(task.files)
    trace = folder / _TRACE
    try:
        with wall_clock_limit(task.limit):
            result = task.execute_run(task.spec, task.scene, trace_path=trace)
    except Exception as error:
        problem = ExecutedRun(problem=f"{type(error).__name__}: {error}")
        write_atomically(folder / _EXECUTION, codec.to_json(problem))
        return
    if result.stopped:
        # When the clock stops a run differs every time: there is nothing to compare.
        execution = ExecutedRun(problem=result.note)
    else:
        execution, _ = _measure(read_trace(trace))
        if task.against is not None:
            execution = replace(execution, difference=first_difference(task.against, trace))
    write_atomically(folder / _EXECUTION, codec.to_json(execution))
