"""Validation of submissions, and of the runs that a search adds."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

from daemon.batch.errors import Refused, Unavailable
from daemon.batch.paths import StatePaths
from daemon.batch.server._dispatcher import read_request
from daemon.batch.stores import is_intact
from daemon.model.assessments import RepeatPolicy
from daemon.model.ids import is_id, trace_name
from daemon.model.search import ExtendRequest
from daemon.model.spec import ENGINE_VERSION, RunSpec
from daemon.model.submission import MOST_RUNS, Submission, too_many_runs
from daemon.model.verbs import EXTEND, SUBMIT
from grammars.text import codec
from grammars.text.files import write_atomically

_SHOWN: Final = 10
"""Most problems in a refusal: one missing scene is a problem of every cell."""


def read_submission(payload: bytes, paths: StatePaths) -> Submission:
    """Check a raw submission and store its scenes; raises as :func:`admit_submission`."""
    submission = read_request(SUBMIT, payload)
    assert isinstance(submission, Submission)
    admit_submission(submission, paths)
    return submission


def admit_submission(submission: Submission, paths: StatePaths) -> None:
    """Check a submission and store its scenes.

    Raises :class:`Refused` with all problems, and :class:`Unavailable` for errors such as a full
    disk.
    """
    _refuse_problems(_problems(submission, paths))
    # After all checks, and before the ledger has the runs: an unused scene is harmless.
    try:
        for scene in submission.scenes:
            path = paths.scene(scene.digest)
            if is_intact(path):
                os.utime(path)  # touched, so that it is not a stray before the commit
            else:
                write_atomically(path, codec.to_json(scene))
    except OSError as error:
        raise Unavailable(f"the submission cannot be stored: {error}") from error


def read_extension(payload: bytes, paths: StatePaths) -> ExtendRequest:
    """Check new runs of a search and store their scenes; raises as :func:`admit_submission`."""
    request = read_request(EXTEND, payload)
    assert isinstance(request, ExtendRequest)
    _refuse_problems(_extension_problems(request))
    admit_submission(request.runs, paths)
    return request


def _extension_problems(request: ExtendRequest) -> Iterator[str]:
    proposals, runs = request.proposals, request.runs
    if len(runs.runs) != len(proposals) or runs.reserve:
        yield f"there are {len(runs.runs)} runs for {len(proposals)} proposals"
        return
    for place, (proposal, run) in enumerate(zip(proposals, runs.runs, strict=True)):
        if proposal.position != proposals[0].position + place:
            yield f"the position {proposal.position} of a proposal does not follow the one before"
        if proposal.repeat != run.repeat:
            yield f"repeat {run.repeat} was proposed as repeat {proposal.repeat}"


def _refuse_problems(problems: Iterable[str]) -> None:
    every = list(problems)
    if every:
        more = f"\nand {len(every) - _SHOWN} more" if len(every) > _SHOWN else ""
        raise Refused("\n".join(every[:_SHOWN]) + more)


def _problems(submission: Submission, paths: StatePaths) -> Iterator[str]:
    if not is_id(submission.campaign):
        yield f"{submission.campaign!r} is not a campaign id: use up to 100 of A-Z a-z 0-9 _ -"
        return
    if not submission.runs:
        yield "the campaign has no runs"
    runs, cells = (*submission.runs, *submission.reserve), submission.cells
    if len(runs) > MOST_RUNS:
        yield too_many_runs(len(runs))
        return
    yield from _policy_problems(submission.declared.policy)
    scripts = len(submission.scripts)
    if any(run.cell >= len(cells) or run.script >= scripts for run in runs):
        raise Refused("the request is malformed: a run refers to a missing cell or script")
    scenes = {scene.digest for scene in submission.scenes}
    for cell in cells:
        for problem in _cell_problems(cell, scenes, paths):
            yield f"{cell.scenario}/{cell.sut.name}: {problem}"
    names = Counter(
        (cells[run.cell].scenario, cells[run.cell].sut.name, run.repeat) for run in runs
    )
    for (scenario, sut, repeat), count in names.items():
        if count > 1:
            yield (
                f"{scenario}/{sut}/{repeat} occurs twice: scenario, system and repeat name a run"
            )
        try:
            trace_name(submission.campaign, scenario, sut, repeat)
        except ValueError as error:
            yield str(error)


def _policy_problems(policy: RepeatPolicy) -> Iterator[str]:
    if not 1 <= policy.n <= MOST_RUNS:
        yield f"the policy's n must be from 1 to {MOST_RUNS} repeats, not {policy.n}"
    elif policy.until_decided and not policy.n <= policy.at_most <= MOST_RUNS:
        allowed = f"from {policy.n} (its n) to {MOST_RUNS} repeats"
        yield f"the policy's at_most must be {allowed}, not {policy.at_most}"
    if not 0.0 <= policy.rate <= 1.0:
        yield f"the policy's rate must be from 0 to 1, not {policy.rate}"


def _cell_problems(cell: RunSpec, scenes: set[str], paths: StatePaths) -> Iterator[str]:
    if cell.engine != ENGINE_VERSION:
        yield f"made for engine {cell.engine}, this daemon has {ENGINE_VERSION}"
    if not (math.isfinite(cell.limit) and cell.limit > 0.0):
        yield f"the limit must be a positive number of seconds, not {cell.limit}"
    for name, digest in cell.sut.files.items():
        if not _is_there(paths.files / digest):
            yield f'the file "{name}" of {cell.sut.name} was not sent'
    digest = cell.map.file
    if digest and not _is_there(paths.files / digest):
        yield f"its map {digest[:12]} was not sent"
    if cell.scene not in scenes and not _is_stored(cell.scene, paths):
        yield f"its scene {cell.scene[:12]} is neither here nor in the submission"


def _is_stored(digest: str, paths: StatePaths) -> bool:
    try:
        return _is_there(paths.scene(digest))
    except ValueError:
        return False


def _is_there(path: Path) -> bool:
    """Return whether a file exists; touch it, so that it is not a stray before the commit."""
    try:
        os.utime(path)
    except FileNotFoundError:
        return False
    return True
