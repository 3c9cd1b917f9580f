"""Submissions that the daemon admits: those that make sense, made ready for the ledger."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from daemon.batch.errors import Refused, Unavailable
from daemon.batch.inputs import keep_scene
from daemon.batch.ledger import AdmittedSubmission, prepare_submission
from daemon.batch.paths import StatePaths
from daemon.batch.server._dispatcher import read_request
from daemon.model.attachments import attached_digests
from daemon.model.ids import is_id, trace_name
from daemon.model.packed_submission import (
    MOST_RUNS,
    PackedRun,
    PackedSubmission,
    too_many_runs,
)
from daemon.model.spec import ENGINE_VERSION, RunSpec
from daemon.model.verbs import SUBMIT

_SHOWN: Final = 10
"""Problems that are said: who has forgotten a file has forgotten it for 100,000 runs."""


def prepare_request(payload: bytes, paths: StatePaths) -> AdmittedSubmission:
    """Check a submission as it came and make it ready for the ledger; stores its scenes.

    Raises :class:`Refused` with all that is wrong, and :class:`Unavailable` when the disk is full,
    say.
    """
    packed = read_request(SUBMIT, payload)
    assert isinstance(packed, PackedSubmission)
    return admit_submission(packed, paths)


def admit_submission(packed: PackedSubmission, paths: StatePaths) -> AdmittedSubmission:
    """Check a submission, store its scenes, make it ready; raises as :func:`prepare_request`."""
    problems = _Problems()
    for problem in _problems(packed, paths):
        problems.add(problem)
    problems.raise_any()
    # Only when all is well, and before the ledger has the runs: a scene too many is harmless.
    try:
        for scene in packed.scenes:
            keep_scene(paths.scene(scene.digest), scene)
    except OSError as error:
        raise Unavailable(f"the submission cannot be stored: {error}") from error
    return prepare_submission(packed)


class _Problems:
    """Counts problems and keeps the first ones."""

    def __init__(self) -> None:
        self._shown: list[str] = []
        self._more = 0

    def add(self, problem: str) -> None:
        if len(self._shown) < _SHOWN:
            self._shown.append(problem)
        else:
            self._more += 1

    def raise_any(self) -> None:
        if self._shown:
            more = f"\nand {self._more} more" if self._more else ""
            raise Refused("\n".join(self._shown) + more)


def _problems(packed: PackedSubmission, paths: StatePaths) -> Iterator[str]:
    if not is_id(packed.campaign):
        yield f"{packed.campaign!r} is not a campaign id: use up to 100 of A-Z a-z 0-9 _ -"
        return
    if not packed.runs:
        yield "the campaign has no runs"
    count = len(packed.runs) + len(packed.reserve)
    if count > MOST_RUNS:
        yield too_many_runs(count)
        return
    cells = _CheckedCells(packed, paths)
    for runs in (packed.runs, packed.reserve):
        for run in runs:
            yield from cells.problems(run)


class _CheckedCells:
    """What is wrong with runs, most of which is wrong with their cells: looked at once each."""

    def __init__(self, packed: PackedSubmission, paths: StatePaths) -> None:
        self._packed = packed
        self._cells = packed.cells
        scenes = {scene.digest for scene in packed.scenes}
        self._wrong = [tuple(_cell_problems(cell, scenes, paths)) for cell in packed.cells]
        # Cells of one scenario and system are one as far as names of runs go.
        names: dict[tuple[str, str], int] = {}
        self._names = [
            names.setdefault((cell.scenario, cell.sut.name), len(names)) for cell in packed.cells
        ]
        self._most = [_highest_repeat(packed.campaign, cell) for cell in packed.cells]
        self._seen: set[int] = set()

    def problems(self, run: PackedRun) -> Iterator[str]:
        cell, script, repeat, _ = run
        if cell >= len(self._cells) or script >= len(self._packed.scripts):
            raise Refused(
                "the request is malformed: "
                f"there is no cell {cell} or no script {script} in the submission"
            )
        for problem in self._wrong[cell]:
            yield f"{self._label(run)}{problem}"
        if not 0 <= repeat <= self._most[cell]:
            same = self._cells[cell]
            try:
                trace_name(self._packed.campaign, same.scenario, same.sut.name, repeat)
            except ValueError as error:
                yield str(error)
            return
        # One number for both, which takes a third of the memory of a text.
        name = repeat * len(self._cells) + self._names[cell]
        if name in self._seen:
            yield f"{self._label(run)} is there twice: scenario, system and repeat name a run"
        self._seen.add(name)

    def _label(self, run: PackedRun) -> str:
        cell = self._cells[run.cell]
        return f"{cell.scenario}/{cell.sut.name}/{run.repeat}"


def _highest_repeat(campaign: str, cell: RunSpec) -> int:
    """The highest repeat that makes a usable name of a trace, below 0 when none does."""
    highest = -1
    for digits in range(1, 18):
        try:
            trace_name(campaign, cell.scenario, cell.sut.name, 10**digits - 1)
        except ValueError:
            break
        highest = 10**digits - 1
    return highest


def _cell_problems(cell: RunSpec, scenes: set[str], paths: StatePaths) -> Iterator[str]:
    if cell.engine != ENGINE_VERSION:
        yield f": made for engine {cell.engine}, this daemon has {ENGINE_VERSION}"
    if not (math.isfinite(cell.limit) and cell.limit > 0.0):
        yield f": the limit must be a positive number of seconds, not {cell.limit}"
    for name, digest in attached_digests(cell.sut.parameters).items():
        if not _is_there(paths.files / digest):
            yield f': the file "{name}" of {cell.sut.name} was not sent along'
    digest = cell.map.file
    if digest and not _is_there(paths.files / digest):
        yield f": its map {digest[:12]} was not sent along"
    if cell.scene not in scenes and not _is_stored(cell.scene, paths):
        yield f": its scene {cell.scene[:12]} is neither here nor sent along"


def _is_stored(digest: str, paths: StatePaths) -> bool:
    try:
        return _is_there(paths.scene(digest))
    except ValueError:
        return False


def _is_there(path: Path) -> bool:
    """Whether there is a file that a campaign on its way needs; then it is not a stray for now."""
    try:
        os.utime(path)
    except FileNotFoundError:
        return False
    return True
