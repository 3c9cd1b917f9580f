"""What the daemon admits: submissions that make sense, and traces while there is room for them."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from typing import Final

from daemon.batch.amounts import size_text
from daemon.batch.errors import DaemonError, Refused
from daemon.batch.inputs import keep_scene
from daemon.batch.ledger import RetentionPolicy, stored_bytes, sweep_traces
from daemon.batch.paths import StatePaths
from daemon.batch.server._runtime import EventLog
from daemon.model.attachments import attached_digests
from daemon.model.ids import is_id, trace_name
from daemon.model.packed_submission import MOST_RUNS
from daemon.model.spec import ENGINE_VERSION, RunSpec
from daemon.model.status import Submission
from grammars.model.scene import Scene

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
        keep_scene(paths.scene(digest), scene)


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
    digest = run.map.file
    if digest and digest not in known:
        if (paths.files / digest).exists():
            known.add(digest)
        else:
            yield f"{run.label}: its map {digest[:12]} was not sent along"


def _is_stored(digest: str, paths: StatePaths) -> bool:
    try:
        return paths.scene(digest).exists()
    except ValueError:
        return False


# Seconds between two looks: regularly, and at least, when the quota is reached.
_PERIOD: Final = 60.0
_REST: Final = 1.0
# A look reads the folder of every campaign and may take long with many traces: a rest of at least
# so many times its length keeps it below 5 % of a core and of the disk.
_SHARE: Final = 20.0
# Part of the quota that is left after sweeping, so that not every trace makes us look again.
_LEAST: Final = 0.95


class Quota(threading.Thread):
    """Keeps the traces below ``limit`` bytes (0: no limit) until closed.

    ``used`` is what they take now, as far as is known; ``trouble`` says why no run may start.
    """

    def __init__(
        self, paths: StatePaths, log: EventLog, limit: int, now: Callable[[], float]
    ) -> None:
        super().__init__(name="quota", daemon=True)
        self.limit = limit
        self.used = 0
        self.trouble = ""
        self._paths = paths
        self._log = log
        self._now = now
        self._wake = threading.Event()
        self._closing = threading.Event()

    def add_bytes(self, size: int) -> None:
        """A trace of ``size`` bytes came; looks soon if that was too much."""
        self.used += size
        if self.limit and self.used > self.limit:
            self._wake.set()

    def run(self) -> None:
        """Look now and then until closed."""
        while not self._closing.is_set():
            begun = time.monotonic()
            try:
                self._enforce()
            except (DaemonError, OSError) as error:
                self._log.write("quota not kept", problem=str(error))
            self._closing.wait(max(_REST, _SHARE * (time.monotonic() - begun)))
            # With no run allowed to start nothing will wake us: room is looked for again and again.
            if not self.trouble:
                self._wake.wait(_PERIOD)
            self._wake.clear()

    def close(self) -> None:
        """Finish what is under way."""
        self._closing.set()
        self._wake.set()
        if self.is_alive():
            self.join()

    def _enforce(self) -> None:
        self.used = stored_bytes(self._paths)
        if self.limit and self.used > self.limit:
            swept = sweep_traces(
                self._paths, RetentionPolicy(size=int(_LEAST * self.limit)), self._now()
            )
            self.used = swept.kept
            if swept.gone:
                campaigns = list(dict.fromkeys(trace.campaign for trace in swept.gone))
                self._log.write(
                    "traces removed", bytes=swept.freed, traces=len(swept.gone), of=campaigns[:20]
                )
        self._update_trouble()

    def _update_trouble(self) -> None:
        before, self.trouble = self.trouble, self._trouble_text()
        if bool(before) != bool(self.trouble):
            self._log.write("quota", trouble=self.trouble, bytes=self.used)

    def _trouble_text(self) -> str:
        if not self.limit or self.used <= self.limit:
            return ""
        return (
            f"traces of unfinished campaigns take {size_text(self.used)}, the quota is "
            f"{size_text(self.limit)}: no more runs start until there is room; start the daemon "
            "with a larger --quota, or cancel a campaign"
        )
