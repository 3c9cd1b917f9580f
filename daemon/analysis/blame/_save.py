"""The smallest failing run as a campaign of its own: a folder that can be handed on."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from daemon.analysis.blame._case import Candidate, RunCase
from daemon.analysis.blame._elements import Blame
from daemon.analysis.blame._runner import BudgetSpentError, CandidateRunner
from daemon.analysis.blame._search import BlameResult
from daemon.campaign import (
    FLOORPLAN,
    MISSION,
    ROBOT,
    SCENERY,
    LayerKind,
    LayerReference,
    ResolvedScenario,
    campaign_text,
    expand,
    find_layer,
    load_campaign,
    parameter_tree,
    required,
)
from daemon.model.attachments import FILES_PARAMETER, stored_file
from daemon.model.spec import RunSpec, SutReference
from daemon.run_map import stored_map
from daemon.stacks.registry import stack_kind
from grammars.jsonld import scene_document
from grammars.model.map_files import write_map
from grammars.text.sources import is_jsonld
from grammars.text.yaml_text import yaml_text

SCENARIO: Final = "minimal"


@dataclass(frozen=True, slots=True)
class _Folder:
    """Files to be, by their names."""

    path: Path

    def write(self, name: str, text: str) -> str:
        """Write a file and return its name."""
        target = self.path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="utf-8")
        return name

    def copy(self, name: str, source: Path) -> str:
        """Copy a file, or a folder that is one layer, and return its name here."""
        target = self.path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, target, dirs_exist_ok=True)
            return name
        # The line that tells editors where the schema is leads nowhere from here.
        lines = source.read_bytes().splitlines(keepends=True)
        kept = (line for line in lines if not line.startswith(b"# yaml-language-server:"))
        target.write_bytes(b"".join(kept))
        return name


def save_campaign(case: RunCase, found: BlameResult, path: Path, runner: CandidateRunner) -> Path:
    """Write the smallest failing run to the folder ``path`` and return the campaign file.

    Layers are copied as they are, and the scenario says without which of their parts it is run;
    the run that the campaign specifies is the one that failed, seed included. Raises ``OSError``,
    and ``ValueError`` when the files would specify another run: nothing may be handed on that does
    not fail in the same way.
    """
    path.mkdir(parents=True, exist_ok=True)
    folder = _Folder(path)
    smallest, repeat = _earliest_repeat(case, found, runner)
    (oracle,) = smallest.spec.oracles
    here = case.cell.scenario.where
    scenario = _copied(case, case.scenario(found.away), folder)
    scenario = replace(
        scenario,
        about="",
        suts=(LayerReference(_sut(case, found, folder), {}, here),),
        oracles=(LayerReference(oracle.name, {}, here),),
    )
    oracles = folder.write("minimal.oracles.yaml", yaml_text({oracle.name: oracle.text}))
    text = campaign_text(
        replace(case.campaign, name=_name(case), oracle_layers=(oracles,)),
        scenario,
        name=SCENARIO,
        repeats=repeat + 1,
        about=f"{case.spec.label} of {case.campaign.name}, reduced to what makes it fail",
        comment=_comment(found.story, repeat),
    )
    file = path / folder.write("campaign.yaml", text)
    _verify(file, smallest.spec)
    return file


def _earliest_repeat(
    case: RunCase, found: BlameResult, runner: CandidateRunner
) -> tuple[Candidate, int]:
    """Return the run in repeat 0 if it fails there too, otherwise as it is, with its repeat.

    A campaign always has the repeats before one, so the first one is the one to have.
    """
    smallest, repeat = found.smallest, case.spec.repeat
    if repeat == 0 or found.story.stopped:
        return smallest, repeat
    first = case.candidate(found.away, smallest.spec.oracles[0], repeat=0)
    try:
        return (first, 0) if runner.first_failing([first]) == 0 else (smallest, repeat)
    except (BudgetSpentError, KeyboardInterrupt):
        return smallest, repeat  # what was found is kept


def _copied(case: RunCase, scenario: ResolvedScenario, folder: _Folder) -> ResolvedScenario:
    """Return a scenario that names copies of its layers, in ``folder``."""

    copies: dict[Path, str] = {}

    def copy(reference: LayerReference, kind: LayerKind) -> LayerReference:
        source = find_layer(case.folder, reference, kind)
        if source not in copies:
            name = f"{kind.folder}/{source.name}"
            if name in copies.values():  # a layer in another folder is called so as well
                name = f"{kind.folder}/{len(copies)}/{source.name}"
            copies[source] = folder.copy(name, source)
        return replace(reference, name=copies[source])

    settings, map_file = case.spec.map, None
    if settings.file:
        grid, height = stored_map(settings.file), case.spec.robot.laser.z
        _, written = write_map(grid, folder.path / "map", laser_height=height)
        map_file = LayerReference(written.name, {}, scenario.where)
    return replace(
        scenario,
        vary=None,
        floorplan=_plan(case, scenario, folder) or copy(required(scenario.floorplan), FLOORPLAN),
        objects=tuple(copy(one, SCENERY) for one in scenario.objects),
        behaviours=tuple(copy(one, SCENERY) for one in scenario.behaviours),
        mission=copy(required(scenario.mission), MISSION),
        robot=copy(required(scenario.robot), ROBOT),
        map_file=map_file,
    )


def _plan(case: RunCase, scenario: ResolvedScenario, folder: _Folder) -> LayerReference | None:
    """Write a plan that is no single file: a variant, or a model in several JSON files."""
    if scenario.vary is None:
        source = find_layer(case.folder, required(scenario.floorplan), FLOORPLAN)
        if source.suffix == ".jsonld" or not is_jsonld(source):
            return None
    # Who gets the folder must not have to draw the variant again.
    plan = case.cell.plan
    text = json.dumps(scene_document(plan), indent=1)
    name = folder.write(f"floorplans/{plan.name}.jsonld", text)
    return LayerReference(name, {}, scenario.where)


def _sut(case: RunCase, found: BlameResult, folder: _Folder) -> str:
    """Write the system under test, as differences from the one it is like where it has any."""
    sut, settings = found.smallest.spec.sut, case.settings
    file = f"suts/{sut.name}.yaml"
    changes = parameter_tree(settings.remaining(found.away))
    if stack_kind(sut.kind).keys or sut.files or not settings.like or not changes:
        return folder.write(file, yaml_text(_whole_sut(sut, folder)))
    # The saved system keeps its name, which verdicts show; the one it is like makes room.
    like = settings.like if settings.like != sut.name else f"{sut.name}-base"
    base = {"sut": like, "kind": sut.kind, "parameters": parameter_tree(settings.base)}
    folder.write(f"suts/{like}.yaml", yaml_text(base))
    return folder.write(file, yaml_text({"sut": sut.name, "like": like, "parameters": changes}))


def _whole_sut(sut: SutReference, folder: _Folder) -> dict[str, Any]:
    """Return what the file of a system says; the files it needs are copied beside it."""
    keys: dict[str, Any] = {"parameters": sut.parameters}
    if own := stack_kind(sut.kind).keys:
        keys = {name: sut.parameters[name] for name in own if name in sut.parameters}
    for name, digest in sut.files.items():
        folder.copy(f"suts/files/{name}", stored_file(digest))
    files = {FILES_PARAMETER: {name: f"files/{name}" for name in sut.files}} if sut.files else {}
    return {"sut": sut.name, "kind": sut.kind, **keys, **files}


def _name(case: RunCase) -> str:
    words = ("blame", case.campaign.name, *case.spec.label.split("/"))
    return re.sub(r"[^A-Za-z0-9_-]+", "-", "-".join(words))[:60]


def _comment(story: Blame, repeat: int) -> str:
    otherwise = ", or fail for another reason" if story.layers else ""
    lines = [
        f"What is left of {story.run}, which failed {story.verdict.oracle}.",
        f"Nothing else can be taken away: it would pass{otherwise}."
        if story.minimal
        else f"There may be more to take away: {story.stopped}.",
    ]
    if repeat:
        lines.append(f"It is repeat {repeat} that fails; the ones before may pass.")
    return "\n".join(lines)


def _verify(file: Path, wanted: RunSpec) -> None:
    """Hold the written campaign to specifying the run it was written for."""
    runs = expand(load_campaign(file)).specs
    found = next(run for run in runs if run.repeat == wanted.repeat)
    for name in ("scene", "robot", "mission", "behaviours", "oracles", "map", "seed", "limit"):
        if getattr(found, name) != getattr(wanted, name):
            raise ValueError(f"{file} would specify another run: its {name} differs")
    if replace(found.sut, name=wanted.sut.name) != wanted.sut:
        raise ValueError(f"{file} would specify another run: its system under test differs")
