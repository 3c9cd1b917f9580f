"""Submission of a campaign to the daemon, with the common parts of its runs stored once.

A run is a *cell* (everything common to all repeats of a scenario with a system), a *script* (the
behaviours of doors and people) and two numbers. A hundred thousand runs of building C take 630 MB
in full, and a few MB like this.
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
"""Most runs of a campaign, including repeats in reserve: one transaction enters them all."""

_Number = Annotated[int, Field(ge=0)]


class CellRun(NamedTuple):
    """A run of a campaign; cell and script are their numbers in the :class:`Submission`."""

    cell: _Number
    script: _Number
    repeat: _Number
    seed: int


@dataclass(frozen=True, slots=True)
class CampaignOrigin:
    """File of a campaign, and the state of its folder under version control.

    ``file`` is a name without folders, ``path`` its path on the machine that submitted it,
    ``digest`` the SHA-256 of its text, ``seed`` the one in it. ``commit`` and ``branch`` are git's,
    empty without a repository or git. ``changed``: there were uncommitted changes, ``None`` if
    unknown. All fields are empty for campaigns entered before these were recorded.
    """

    file: str = ""
    digest: str = ""
    seed: int | None = None
    commit: str = ""
    branch: str = ""
    changed: bool | None = None
    # Omitted if empty: ids of campaigns are digests of all the rest.
    path: Annotated[str, Field(exclude_if=operator.not_)] = ""


@dataclass(frozen=True, slots=True)
class Submission:
    """A campaign for the daemon; ``campaign`` is a unique id made by the client.

    Submitting the same id again changes nothing. ``source`` is the campaign file's text.
    ``cells`` are runs without repeat, script and seed (:attr:`daemon.model.spec.RunSpec.cell`).
    Runs in ``reserve`` are for cells that the rules in ``declared`` leave undecided after the
    repeats before. Results in the ledger under another campaign are reused unless ``fresh``.
    ``origin`` does not count: from another commit it is the same campaign.
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
        """Digest of everything except its origin."""
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
    """Return the message for a campaign with too many runs."""
    return (
        f"the campaign has {count} runs, including repeats in reserve; the limit is {MOST_RUNS}: "
        "split its scenarios among several campaigns"
    )
