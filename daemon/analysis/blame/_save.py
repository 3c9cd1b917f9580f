"""The smallest failing run as a campaign of its own: a folder that can be handed on."""

from __future__ import annotations

import dataclasses
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeVar

from daemon.analysis.blame._case import Candidate, RunCase
from daemon.analysis.blame._elements import Blame
from daemon.analysis.blame._layer_text import (
    behaviour_sentences,
    layer_text,
    reduce_layers,
    start_sentences,
)
from daemon.analysis.blame._runner import BudgetSpentError, CandidateRunner
from daemon.analysis.blame._search import BlameResult
from daemon.campaign import (
    FLOORPLAN,
    ROBOT,
    expand,
    find_layer,
    load_campaign,
    noise_seed,
    parameter_tree,
)
from daemon.model.attachments import FILES_PARAMETER, stored_file
from daemon.model.spec import RunSpec, SutReference
from daemon.run_map import stored_map
from daemon.stacks.registry import stack_kind
from grammars.jsonld import is_jsonld, plan_document, scenery_document
from grammars.model.map_files import write_map
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene
from grammars.text.yaml_text import comment_text, yaml_text

T = TypeVar("T")

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

    def copy(self, name: str, source: Path) -> None:
        """Copy a file as it is."""
        target = self.path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(source.read_bytes())


def save_campaign(case: RunCase, found: BlameResult, path: Path, runner: CandidateRunner) -> Path:
    """Write the smallest failing run to the folder ``path`` and return the campaign file.

    Layers are copied with only what is left of them, paths are relative; the run that the
    campaign specifies is the one that failed, seed included. Raises ``OSError``, and
    ``ValueError`` when the files would specify another run: nothing may be handed on that does
    not fail in the same way.
    """
    folder = _Folder(path)
    smallest, repeat = _earliest_repeat(case, found, runner)
    scenery = [*_objects(case, smallest, folder), *_behaviours(smallest, folder)]
    placed = _parameters(case, found)
    slots = {
        "floorplan": _plan(case, folder),
        "objects": [
            {name: placed[name]} if name in placed else name for name, objects in scenery if objects
        ],
        "behaviours": [name for name, objects in scenery if not objects],
        "mission": folder.write("minimal.mission.yaml", _mission(smallest.spec)),
        "sut": _sut(case, found, folder),
        "oracles": [smallest.spec.oracles[0].name],
    }
    named = _required(case.cell.scenario.robot)
    robot = find_layer(case.folder, named, ROBOT)
    # Copied, not named: the folder is to be handed on with all it needs.
    folder.write("robot.yaml", _without_schema(robot.read_text(encoding="utf-8")))
    oracle = smallest.spec.oracles[0]
    folder.write("minimal.oracles.yaml", yaml_text({oracle.name: oracle.text}))
    head = {
        "campaign": _name(case),
        "about": f"{case.spec.label} of {case.campaign.name}, reduced to what makes it fail",
        "seed": case.campaign.seed,
        "repeats": repeat + 1,
        "limit": f"{case.spec.limit!r} s",
        "robot": named.as_written("robot.yaml"),
        "oracles": "minimal.oracles.yaml",
        "map": _map(case.spec, folder),
        "scenarios": {SCENARIO: {key: value for key, value in slots.items() if value}},
    }
    name = folder.write("campaign.yaml", _comment(found.story, repeat) + yaml_text(head))
    _verify(path / name, smallest.spec)
    return path / name


def _earliest_repeat(
    case: RunCase, found: BlameResult, runner: CandidateRunner
) -> tuple[Candidate, int]:
    """Return the run in repeat 0 if it fails there too, else as it is, with its repeat.

    A campaign always has the repeats before one, so the first one is the one to have.
    """
    smallest, repeat = found.smallest, case.spec.repeat
    if repeat == 0 or found.story.stopped:
        return smallest, repeat
    seed = noise_seed(case.campaign.seed, 0)
    first = Candidate(dataclasses.replace(smallest.spec, repeat=0, seed=seed), smallest.scene)
    try:
        return (first, 0) if runner.first_failing([first]) == 0 else (smallest, repeat)
    except (BudgetSpentError, KeyboardInterrupt):
        return smallest, repeat  # what was found is kept


def _plan(case: RunCase, folder: _Folder) -> Any:
    scenario = case.cell.scenario
    # A variant has no file of its own: it is drawn from the variation layer, whose draws must not
    # be repeated by who gets the folder.
    source = None
    if scenario.vary is None:
        source = find_layer(case.folder, _required(scenario.floorplan), FLOORPLAN)
    # A plan of several JSON-LD files becomes one.
    if source is None or (is_jsonld(source) and source.suffix != ".jsonld"):
        text = json.dumps(plan_document(case.cell.plan), indent=1)
        return folder.write(f"{case.cell.plan.name}.jsonld", text)
    name = folder.write(source.name, source.read_text(encoding="utf-8"))
    return _required(scenario.floorplan).as_written(name)


def _objects(case: RunCase, smallest: Candidate, folder: _Folder) -> list[tuple[str, bool]]:
    """Write the object layers that still place something, and how their objects start."""
    names = {thing.name for thing in smallest.scene.objects}
    whole = {o.plain.file: o.plain for o in case.layers if o.element.kind == "objects"}
    layers = reduce_layers(tuple(whole.values()), names)
    written, loaded = [], []
    for layer in layers:
        if not is_jsonld(Path(layer.file)):
            text = layer_text(layer, whole[layer.file])
            written.append((folder.write(f"{layer.name}.scenery", text), True))
            loaded.append(load_scenery(folder.path / written[-1][0]))
        else:
            document = scenery_document(layer, case.cell.plan, layers)
            text = json.dumps(document, indent=1)
            written.append((folder.write(f"{layer.name}.jsonld", text), True))
            loaded.append(layer)
    text = start_sentences(smallest.scene, compile_scene(case.cell.plan, loaded)) if loaded else ""
    if text:
        written.append((folder.write("starts.scenery", text), True))
    return written


def _parameters(case: RunCase, found: BlameResult) -> dict[str, dict[str, object]]:
    """Return what the campaign says about parameters of object layers, by the names of their files.

    What it says about groups is about sentences, which are written anew.
    """
    told = {}
    for layer in case.layers:
        names = {parameter.name for parameter in layer.plain.parameters}
        values = {
            key: value
            for element, key, value in layer.overrides
            if element in found.left and str(key).replace("-", "_") in names
        }
        if values and layer.element.kind == "objects":
            ending = ".jsonld" if is_jsonld(Path(layer.plain.file)) else ".scenery"
            told[f"{layer.plain.name}{ending}"] = values
    return told


def _behaviours(smallest: Candidate, folder: _Folder) -> list[tuple[str, bool]]:
    behaviours = smallest.spec.behaviours
    if not behaviours:
        return []
    return [
        (folder.write("minimal.scenery", behaviour_sentences(behaviours, smallest.scene)), False)
    ]


def _map(spec: RunSpec, folder: _Folder) -> dict[str, str]:
    settings = spec.map
    if settings.file:
        grid, height = stored_map(settings.file), spec.robot.laser.z
        _, written = write_map(grid, folder.path / "map", laser_height=height)
        return {"file": written.name}
    resolution = f"{settings.resolution!r} m"
    return {"resolution": resolution, "doors": settings.doors, "rule": settings.rule}


def _mission(spec: RunSpec) -> str:
    mission = spec.mission
    start = {"x": mission.start.x, "y": mission.start.y, "yaw": mission.start.yaw}
    waypoints = [
        {"id": w.id, "x": w.x, "y": w.y} | ({} if w.yaw is None else {"yaw": w.yaw})
        for w in mission.waypoints
    ]
    return yaml_text({"mission": mission.name, "start": start, "waypoints": waypoints})


def _sut(case: RunCase, found: BlameResult, folder: _Folder) -> str:
    """Write the system under test, as differences from the one it is like where it has any."""
    sut, settings = found.smallest.spec.sut, case.settings
    file = f"suts/{sut.name}.yaml"
    changes = parameter_tree(settings.kept(found.left))
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
    otherwise = ", or fail for another reason" if story.flips else ""
    lines = [
        f"What is left of {story.run}, which failed {story.verdict.oracle}.",
        f"Nothing else can be taken away: it would pass{otherwise}."
        if story.minimal
        else f"There may be more to take away: {story.stopped}.",
    ]
    if repeat:
        lines.append(f"It is repeat {repeat} that fails; the ones before may pass.")
    return comment_text("\n".join(lines))


def _without_schema(text: str) -> str:
    """Return a file without the line that tells editors where its schema is: it has moved."""
    lines = text.splitlines(keepends=True)
    return "".join(line for line in lines if not line.startswith("# yaml-language-server:"))


def _required(value: T | None) -> T:
    if value is None:
        raise ValueError("a loaded scenario has no empty slot")
    return value


def _verify(file: Path, wanted: RunSpec) -> None:
    """Hold the written campaign to specifying the run it was written for."""
    runs = expand(load_campaign(file)).specs
    found = next(run for run in runs if run.repeat == wanted.repeat)
    for name in ("scene", "robot", "mission", "behaviours", "oracles", "map", "seed", "limit"):
        if getattr(found, name) != getattr(wanted, name):
            raise ValueError(f"{file} would specify another run: its {name} differs")
    if dataclasses.replace(found.sut, name=wanted.sut.name) != wanted.sut:
        raise ValueError(f"{file} would specify another run: its system under test differs")
