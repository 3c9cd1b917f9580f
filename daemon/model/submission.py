"""Campaign on its way to the daemon: what its runs share is there once.

A run is a *cell* (everything that is the same for all repeats of a scenario with a system), a
*script* (what the doors and people do) and two numbers. A hundred thousand runs of building C are
630 MB when each is written out, and a few MB like this.
"""

from __future__ import annotations

import operator
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Final, NamedTuple

from pydantic import Field

from daemon.model.assessments import AssessmentRules
from daemon.model.spec import RunSpec, Script, run_digest, text_digest
from grammars.model.scene import Scene
from grammars.text import codec

MOST_RUNS: Final = 200_000
"""Runs of a campaign, repeats in reserve included: they are entered in one transaction."""

_Number = Annotated[int, Field(ge=0)]


class CellRun(NamedTuple):
    """A run of a campaign; cell and script are their numbers in the :class:`Submission`."""

    cell: _Number
    script: _Number
    repeat: _Number
    seed: int


@dataclass(frozen=True, slots=True)
class CampaignOrigin:
    """Which file a campaign was written in, and the state of its folder under version control.

    ``file`` is a name without folders, ``path`` its place on the machine that submitted it,
    ``digest`` the SHA-256 of its text, ``seed`` the one it names. ``commit`` and ``branch`` are
    git's, empty where there is no repository or no git; ``changed`` says whether something was not
    committed, ``None`` when that is not known. Of a campaign that was entered before this was kept
    nothing is known.
    """

    file: str = ""
    digest: str = ""
    seed: int | None = None
    commit: str = ""
    branch: str = ""
    changed: bool | None = None
    # Left out where it is empty: ids of campaigns are digests of all the rest.
    path: Annotated[str, Field(exclude_if=operator.not_)] = ""


@dataclass(frozen=True, slots=True)
class Submission:
    """A campaign on its way to the daemon; ``campaign`` is a client-made unique id.

    Submitting the same id again changes nothing. ``source`` is the campaign file's text.
    ``cells`` are runs without repeat, script and seed (:attr:`daemon.model.spec.RunSpec.cell`).
    Runs in ``reserve`` wait for cells that ``declared`` leaves undecided after the repeats before.
    Runs that have a result in the ledger under another campaign are not run again unless
    ``fresh``. ``origin`` is no part of what is submitted: from another commit it is the same
    campaign.
    """

    campaign: str
    name: str
    about: str
    source: str
    cells: tuple[RunSpec, ...]
    scripts: tuple[Script, ...]
    runs: tuple[CellRun, ...]
    scenes: tuple[Scene, ...]
    declared: AssessmentRules = field(default_factory=AssessmentRules)
    reserve: tuple[CellRun, ...] = ()
    fresh: bool = False
    origin: CampaignOrigin = field(default_factory=CampaignOrigin)

    @classmethod
    def of(cls, campaign: str, specs: Sequence[RunSpec], scenes: Iterable[Scene]) -> Submission:
        """Return runs as a submission without name and text; each has a cell of its own."""
        runs = (CellRun(i, i, spec.repeat, spec.seed) for i, spec in enumerate(specs))
        cells = tuple(spec.cell for spec in specs)
        scripts = tuple(spec.behaviours for spec in specs)
        return cls(campaign, "", "", "", cells, scripts, tuple(runs), tuple(scenes))

    @property
    def digest(self) -> str:
        """Digest of all there is to it, except where it was written."""
        return codec.digest(replace(self, origin=CampaignOrigin()))

    @property
    def digests(self) -> tuple[str, ...]:
        """The digests of its runs, in order."""
        cells = [text_digest(codec.to_json(cell)) for cell in self.cells]
        scripts = [text_digest(codec.to_json(script, Script)) for script in self.scripts]
        return tuple(
            run_digest(cells[run.cell], scripts[run.script], run.repeat, run.seed)
            for run in self.runs
        )

    @property
    def specs(self) -> tuple[RunSpec, ...]:
        """The specifications of its runs, in order."""
        return tuple(map(self.spec, self.runs))

    def spec(self, run: CellRun) -> RunSpec:
        """Return the specification of a run."""
        cell, script, repeat, seed = run
        behaviours = self.scripts[script]
        return replace(self.cells[cell], repeat=repeat, behaviours=behaviours, seed=seed)


def too_many_runs(count: int) -> str:
    """Say that a campaign has more runs than it may have, and what to do."""
    return (
        f"the campaign has {count} runs, repeats in reserve included, and may have {MOST_RUNS}: "
        "split its scenarios among several campaigns"
    )
