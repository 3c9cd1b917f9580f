"""A loaded campaign, expanded to its runs.

Repeat ``i`` of every cell draws from the same seed, whatever the scenario or the system under
test: the doors and the sensor noise are paired across cells, so cells can be compared run by run.
"""

from __future__ import annotations

import secrets
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from daemon.campaign._cells import CampaignCell
from daemon.campaign._findings import AllowedWarning
from daemon.model.assessments import AssessmentRules
from daemon.model.search import SearchTask
from daemon.model.spec import OracleText, RunSpec, Script, SutReference
from daemon.model.submission import CellRun, Submission
from grammars.text import codec
from grammars.text.diagnostics import Finding

EXTERNAL_REPEATS: Final = 5
"""Runs of a cell whose system is not repeatable, where a campaign does not say how many. As many as
the published evaluation of the reference stack has; five of five that pass show at least 55 %."""


def default_repeats(suts: Iterable[SutReference]) -> int:
    """Return the number of runs of a cell of any of these by default."""
    return max((1 if sut.repeatable else EXTERNAL_REPEATS for sut in suts), default=1)


@dataclass(frozen=True, slots=True)
class Campaign:
    """A loaded campaign: ``cells`` in file order, ``warnings`` about its layers.

    ``repeats`` is ``None`` where the file does not say how often cells are run: once, and more
    often with systems that are not repeatable. ``oracle_layers`` are the names of its oracle files.
    """

    name: str
    about: str
    source: str
    file: str
    seed: int
    repeats: int | None
    declared: AssessmentRules
    oracle_layers: tuple[str, ...]
    cells: tuple[CampaignCell, ...]
    warnings: tuple[Finding, ...]
    searches: tuple[SearchTask, ...] = ()
    """The searches of the file, in its order; they are no part of its runs."""
    allow: tuple[AllowedWarning, ...] = ()
    """Warnings that the file says are meant."""
    allowed: tuple[Finding, ...] = ()
    """Those there are of them; they are not among ``warnings``."""

    def repeats_with(self, sut: SutReference) -> int:
        """Return how many runs every scenario has with a system before anything is decided."""
        return default_repeats([sut]) if self.repeats is None else self.repeats

    @property
    def runs(self) -> int:
        """The number of runs before anything is decided."""
        return sum(self.repeats_with(sut) for cell in self.cells for sut in cell.suts)


def repeat_seed(seed: int, repeat: int) -> np.random.SeedSequence:
    """Return the seed of repeat ``repeat``: the same in every cell of the campaign.

    Spawned, not counted up: with ``seed + repeat`` the second repeat of a campaign with seed 7
    would be the first one of a campaign with seed 8.
    """
    return np.random.SeedSequence(seed, spawn_key=(repeat,))


def noise_seed(seed: int, repeat: int) -> int:
    """Return the seed of a run: the root of all that is drawn while it is simulated."""
    return int(repeat_seed(seed, repeat).generate_state(1, np.uint64)[0])


def expand(campaign: Campaign, *, fresh: bool = False) -> Submission:
    """Return every run of the campaign, scenario by scenario, SUT by SUT, repeat by repeat.

    The campaign's id is its name and a digest of all there is to it, so that submitting the same
    campaign twice is submitting it once; ``fresh`` asks for a new id, to run everything again.
    Repeats beyond those every cell gets are in reserve, for cells that are not decided by then.
    """
    cells: list[RunSpec] = []
    scripts: dict[bytes, tuple[int, Script]] = {}
    runs: list[CellRun] = []
    reserve: list[CellRun] = []
    repeats = max((len(cell.behaviours) for cell in campaign.cells), default=0)
    seeds = [noise_seed(campaign.seed, repeat) for repeat in range(repeats)]
    for cell in campaign.cells:
        scene = cell.scene.digest
        oracles = tuple(OracleText(o.name, o.text) for o in cell.oracles)
        numbers = _number_scripts(cell.behaviours, scripts)
        for sut in cell.suts:
            soon = campaign.repeats_with(sut)
            most = soon if campaign.repeats is None else len(numbers)
            for repeat, script in enumerate(numbers[:most]):
                run = CellRun(len(cells), script, repeat, seeds[repeat])
                (runs if repeat < soon else reserve).append(run)
            spec = run_spec(campaign, cell, sut, 0, behaviours=(), oracles=oracles, scene=scene)
            cells.append(spec.cell)
    scenes = {cell.scene.digest: cell.scene for cell in campaign.cells}
    submission = Submission(
        campaign="",
        name=campaign.name,
        about=campaign.about,
        source=campaign.source,
        cells=tuple(cells),
        scripts=tuple(script for _, script in scripts.values()),
        runs=tuple(runs),
        scenes=tuple(scenes.values()),
        declared=campaign.declared,
        reserve=tuple(reserve),
        fresh=fresh,
    )
    # By content, so that a client that got no answer may submit once more.
    identity = secrets.token_hex(4) if fresh else submission.digest[:8]
    return replace(submission, campaign=f"{campaign.name}-{identity}")


def _number_scripts(
    behaviours: Sequence[Script], scripts: dict[bytes, tuple[int, Script]]
) -> list[int]:
    """Return the numbers of the scripts of each repeat; new ones are added to ``scripts``."""
    numbers = {}
    # Many repeats share one object, which is written out once.
    for key, script in {id(script): script for script in behaviours}.items():
        text = codec.to_json(script, Script)
        numbers[key], _ = scripts.setdefault(text, (len(scripts), script))
    return [numbers[id(script)] for script in behaviours]


def run_spec(
    campaign: Campaign,
    cell: CampaignCell,
    sut: SutReference,
    repeat: int,
    *,
    behaviours: Script,
    oracles: tuple[OracleText, ...],
    scene: str,
) -> RunSpec:
    """Return a run of a cell; ``scene`` is the digest of its scene, which takes a while to make."""
    return RunSpec(
        campaign=campaign.name,
        scenario=cell.name,
        sut=sut,
        repeat=repeat,
        scene=scene,
        robot=cell.robot,
        mission=cell.mission,
        behaviours=behaviours,
        oracles=oracles,
        map=cell.map,
        seed=noise_seed(campaign.seed, repeat),
        limit=cell.limit,
    )
