"""Who may come in: a submission is checked as a whole before the ledger sees it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from daemon.batch.errors import Refused
from daemon.batch.paths import StatePaths
from daemon.model.attachments import attached_digests
from daemon.model.ids import is_id, trace_name
from daemon.model.packed_submission import MOST_RUNS
from daemon.model.spec import ENGINE_VERSION, RunSpec
from daemon.model.status import Submission
from grammars.model.scene import Scene
from grammars.text import codec
from grammars.text.files import write_atomically

_SHOWN: Final = 10
"""Problems that are said: who has forgotten a file has forgotten it for 100,000 runs."""


def admit_submission(submission: Submission, paths: StatePaths) -> None:
    """Check a submission and store its scenes; raises :class:`Refused` with all that is wrong."""
    scenes = {scene.digest: scene for scene in submission.scenes}
    problems = list(_problems(submission, scenes, paths))
    if problems:
        more = f"\nand {len(problems) - _SHOWN} more" if len(problems) > _SHOWN else ""
        raise Refused("\n".join(problems[:_SHOWN]) + more)
    # Only when all is well, and before the ledger has the runs: a scene too many is harmless.
    for digest, scene in scenes.items():
        path = paths.scene(digest)
        if not path.exists():
            write_atomically(path, codec.to_json(scene))


def _problems(submission: Submission, scenes: dict[str, Scene], paths: StatePaths) -> Iterator[str]:
    if not is_id(submission.campaign):
        yield f"{submission.campaign!r} is not a campaign id: use up to 100 of A-Z a-z 0-9 _ -"
        return
    if not submission.runs:
        yield "the campaign has no runs"
    runs = (*submission.runs, *submission.reserve)
    if len(runs) > MOST_RUNS:
        yield f"the campaign has more than {MOST_RUNS} runs"
    seen: set[str] = set()
    known = set(scenes)
    for run in runs:
        yield from _run_problems(submission.campaign, run, seen)
        yield from _lacking_files(run, paths, known)
        if run.scene not in known:
            if _is_stored(run.scene, paths):
                known.add(run.scene)
            else:
                yield f"{run.label}: its scene {run.scene[:12]} is neither here nor sent along"


def _run_problems(campaign: str, run: RunSpec, seen: set[str]) -> Iterator[str]:
    if run.engine != ENGINE_VERSION:
        yield f"{run.label}: made for engine {run.engine}, this daemon has {ENGINE_VERSION}"
    if not (math.isfinite(run.limit) and run.limit > 0.0):
        yield f"{run.label}: the limit must be a positive number of seconds, not {run.limit}"
    try:
        name = trace_name(campaign, run.scenario, run.sut.name, run.repeat)
    except ValueError as error:
        yield str(error)
        return
    if name in seen:
        yield f"{run.label} is there twice: scenario, system and repeat name a run"
    seen.add(name)


def _lacking_files(run: RunSpec, paths: StatePaths, known: set[str]) -> Iterator[str]:
    for name, digest in attached_digests(run.sut.parameters).items():
        if digest in known or (paths.files / digest).exists():
            known.add(digest)
        else:
            yield f'{run.label}: the file "{name}" of {run.sut.name} was not sent along'


def _is_stored(digest: str, paths: StatePaths) -> bool:
    try:
        return paths.scene(digest).exists()
    except ValueError:
        return False
