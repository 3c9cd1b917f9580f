"""A loaded campaign: expanded to its runs, reduced to a file of one scenario, and its origin.

Repeat ``i`` of every cell draws from the same seed, whatever the scenario or the system under
test: the doors and the sensor noise are paired across cells, so cells can be compared run by run.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from daemon.campaign._findings import AllowedWarning
from daemon.campaign._layers import CampaignCell
from daemon.campaign._scenarios import LayerReference, PlanVariation, ResolvedScenario
from daemon.model.assessments import AssessmentRules
from daemon.model.search import SearchTask
from daemon.model.spec import OracleText, RunSpec, Script, SutReference
from daemon.model.submission import CampaignOrigin, CellRun, Submission
from grammars.text import codec
from grammars.text.diagnostics import Finding
from grammars.text.yaml_text import comment_text, yaml_text

EXTERNAL_REPEATS: Final = 5
"""Default number of runs of a cell whose system is not repeatable. The published evaluation of the
reference stack has this many; five passes of five show at least 55 %."""


def default_repeats(suts: Iterable[SutReference]) -> int:
    """Return the default number of runs of a cell with any of these systems."""
    return max((1 if sut.repeatable else EXTERNAL_REPEATS for sut in suts), default=1)


@dataclass(frozen=True, slots=True)
class Campaign:
    """A loaded campaign: ``cells`` in file order, ``warnings`` about its layers.

    ``repeats`` is ``None`` if the file gives no number: cells are run once, and more often with
    systems that are not repeatable. ``oracle_layers`` are the names of its oracle files.
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
    """The searches of the file, in its order; its runs do not contain them."""
    allow: tuple[AllowedWarning, ...] = ()
    """Warnings that the file allows."""
    allowed: tuple[Finding, ...] = ()
    """Allowed warnings that occurred; they are not among ``warnings``."""

    def repeats_with(self, sut: SutReference) -> int:
        """Return the number of runs of every scenario with a system, without the reserve."""
        return default_repeats([sut]) if self.repeats is None else self.repeats

    @property
    def runs(self) -> int:
        """The number of runs without the reserve."""
        return sum(self.repeats_with(sut) for cell in self.cells for sut in cell.suts)


def repeat_seed(seed: int, repeat: int) -> np.random.SeedSequence:
    """Return the seed of repeat ``repeat``: the same in every cell of the campaign.

    Seeds are spawned, not counted up: with ``seed + repeat`` the second repeat of a campaign with
    seed 7 would be the first one of a campaign with seed 8.
    """
    return np.random.SeedSequence(seed, spawn_key=(repeat,))


def noise_seed(seed: int, repeat: int) -> int:
    """Return the seed of a run: the root of everything random in its simulation."""
    return int(repeat_seed(seed, repeat).generate_state(1, np.uint64)[0])


def expand(campaign: Campaign, *, fresh: bool = False) -> Submission:
    """Return every run of the campaign, scenario by scenario, SUT by SUT, repeat by repeat.

    The campaign's id is its name and a digest of its content, so a second submission of the same
    campaign changes nothing. ``fresh`` asks for a new id, to run everything again. Repeats beyond
    those of every cell form the reserve, for cells that are still undecided.
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
    # The id depends on the content, so that a client without an answer may submit again.
    identity = secrets.token_hex(4) if fresh else submission.digest[:8]
    return replace(submission, campaign=f"{campaign.name}-{identity}")


def _number_scripts(
    behaviours: Sequence[Script], scripts: dict[bytes, tuple[int, Script]]
) -> list[int]:
    """Return the number of the script of each repeat; add new ones to ``scripts``."""
    numbers = {}
    # Many repeats share one object, which is serialised once.
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
    """Return a run of a cell; ``scene`` is the digest of its scene, which is slow to compute."""
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


def campaign_text(
    campaign: Campaign,
    scenario: ResolvedScenario,
    *,
    name: str,
    sut: int | None = None,
    repeats: int = 1,
    about: str = "",
    comment: str = "",
    expect: Sequence[Mapping[str, Any]] = (),
) -> str:
    """Return a campaign file with one scenario alone, for the folder of ``campaign``.

    It contains everything that the scenario inherits, and the values beside layer names. Its runs
    have the digests of those of ``campaign`` if the scenario is called ``name`` there. ``sut`` is
    the number of a system under test of the scenario, ``None`` for all of them. Comparisons need
    several scenarios, so they and their measures on legs are left out.
    """
    suts = scenario.suts if sut is None else (scenario.suts[sut],)
    head: dict[str, Any] = {
        "campaign": campaign.name,
        "about": about,
        "seed": campaign.seed,
        "repeats": repeats,
        "limit": _quantity(scenario.limit, "s"),
        "robot": _named(scenario.robot),
        "matrix": {"sut": _list(suts)},
        "oracles": list(campaign.oracle_layers),
        "map": _map(scenario),
        "scenarios": {name: _slots(scenario)},
        "expect": [dict(one) for one in expect],
    }
    return comment_text(comment) + yaml_text(_filled(head), plain=True)


def _slots(scenario: ResolvedScenario) -> dict[str, Any]:
    slots = {
        "about": scenario.about,
        "floorplan": _named(scenario.floorplan),
        "vary": _vary(scenario.vary),
        "objects": _list(scenario.objects),
        "behaviours": _list(scenario.behaviours),
        "mission": _named(scenario.mission),
        "without": _list(scenario.without),
        "oracles": _list(scenario.oracles),
        "chance": scenario.chance,
    }
    return _filled(slots)


def _filled(tree: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in tree.items() if value not in (None, "", [], {})}


def _named(reference: LayerReference | None) -> Any:
    return None if reference is None else reference.as_written()


def _list(references: Sequence[LayerReference]) -> list[Any]:
    return [_named(reference) for reference in references]


def _vary(vary: PlanVariation | None) -> dict[str, Any] | None:
    if vary is None:
        return None
    samples = {} if vary.samples is None else {"samples": vary.samples}
    return {"floorplan": _named(vary.floorplan), **samples, "cover": vary.cover, "seed": vary.seed}


def _map(scenario: ResolvedScenario) -> dict[str, str]:
    if scenario.map_file is not None:
        return {"file": scenario.map_file.name}
    settings = scenario.map
    return {
        "resolution": _quantity(settings.resolution, "m"),
        "doors": settings.doors,
        "rule": settings.rule,
    }


def _quantity(value: float, unit: str) -> str:
    """Return a quantity that reads back as exactly the same value."""
    return f"{repr(value).removesuffix('.0')} {unit}"


_GIT_TIMEOUT: Final = 5.0
"""Longest wait [s] for git: the commit of a repository on a slow disk stays unknown."""
_GIT_SETTINGS: Final = (
    "GIT_CEILING_DIRECTORIES", "GIT_CONFIG_GLOBAL", "GIT_CONFIG_NOSYSTEM", "GIT_CONFIG_SYSTEM",
    "GIT_DISCOVERY_ACROSS_FILESYSTEM", "GIT_EXEC_PATH",
)  # fmt: skip
"""Variables that configure git here; all others concern one repository or one call."""


def campaign_origin(campaign: Campaign, file: Path) -> CampaignOrigin:
    """Return the origin of a campaign that was loaded from ``file``.

    The commit is empty without git, outside a repository and in one that git does not trust. It is
    also empty for an ignored file, such as a shipped one in somebody's environment. ``changed``
    means that a file known to git differs from the commit, or that git does not know this one.
    """
    digest = hashlib.sha256(campaign.source.encode()).hexdigest()
    unknown = CampaignOrigin(file.name, digest, campaign.seed, path=str(file.absolute()))
    how = ("--porcelain=v2", "--branch", "--no-ahead-behind", "--untracked-files=no")
    status = _git(file.parent, "status", *how)
    if status is None:
        return unknown
    tracked = _git(file.parent, "ls-files", "--error-unmatch", "--", file.name) is not None
    if not tracked and _git(file.parent, "check-ignore", "-q", "--", file.name) is not None:
        return unknown
    lines = status.splitlines()
    heads = dict(line[2:].split(" ", 1) for line in lines if line.startswith("# branch."))
    commit, branch = heads.get("branch.oid", ""), heads.get("branch.head", "")
    return replace(
        unknown,
        commit="" if commit == "(initial)" else commit,
        branch="" if branch == "(detached)" else branch,
        changed=not tracked or any(not line.startswith("#") for line in lines),
    )


def _git(folder: Path, *words: str) -> str | None:
    """Return git's output about the folder, ``None`` after an error or a timeout."""
    # The query must change nothing (no lock, no refreshed index) and start nothing: the settings of
    # a repository may name a program that watches it. Answers must not depend on the language.
    command = ["git", "-c", "core.fsmonitor=false", "-C", str(folder), *words]
    # Tests may start from a hook of another repository, which sets its index and objects.
    environment = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith("GIT_") or name in _GIT_SETTINGS
    } | {"GIT_OPTIONAL_LOCKS": "0", "LC_ALL": "C"}
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_GIT_TIMEOUT,
            env=environment,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.decode("utf-8", errors="replace")
