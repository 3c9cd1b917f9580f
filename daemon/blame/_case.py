"""A run taken apart: the elements it is made of, and the run that any of them make together."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from daemon.blame._events import Surviving, without_lost
from daemon.blame._settings import Differences, differences
from daemon.blame._types import Element
from daemon.campaign import Campaign, Cell, expand, load_campaign
from daemon.campaign.layers import Library
from daemon.campaign.load import repeat_seed
from daemon.campaign.text import Reference
from daemon.spec import OracleText, RunSpec
from grammars.behaviour import Behaviour, Walk
from grammars.composition import compile_scene, resolve_behaviours
from grammars.diagnostics import Diagnostic, InputError, Where, did_you_mean
from grammars.movers import is_mover
from grammars.scene import Scene, SceneObject
from grammars.scenery import SceneryLayer, configure


@dataclass(frozen=True, slots=True)
class Candidate:
    """A run to execute."""

    spec: RunSpec
    scene: Scene


@dataclass(frozen=True, slots=True)
class Layer:
    """A scenery layer of the scenario as its file has it, and what the campaign says about it."""

    element: Element
    reference: Reference
    plain: SceneryLayer
    overrides: tuple[tuple[Element, str, object], ...]


@dataclass(slots=True)
class Case:
    """A run of a campaign with everything it is made of.

    ``layers`` are in the order of the scenario, objects before behaviours. The elements of a kind
    are in the order in which the campaign adds them.
    """

    campaign: Campaign
    cell: Cell
    folder: Path
    spec: RunSpec
    scene: Scene
    layers: tuple[Layer, ...]
    settings: Differences
    _worlds: dict[frozenset[Element], tuple[Scene, tuple[Behaviour, ...]]] = field(
        default_factory=dict
    )

    @property
    def added(self) -> tuple[Element, ...]:
        """Layers, overrides and parameters: what the campaign adds to a bare building."""
        layers = [layer.element for layer in self.layers]
        overrides = [element for layer in self.layers for element, _, _ in layer.overrides]
        return (*layers, *overrides, *self.settings.elements)

    def parts(self, added: Collection[Element]) -> tuple[Element, ...]:
        """Return the single things in a run of the elements ``added``."""
        scene, behaviours = self._world(added)
        waypoints = self.spec.mission.waypoints
        return (
            *(Element("object", thing.name) for thing in scene.objects),
            *(Element("waypoint", waypoint.id, i) for i, waypoint in enumerate(waypoints)),
            *(Element("behaviour", named(behaviour)) for behaviour in behaviours),
        )

    def candidate(self, kept: Collection[Element], oracle: OracleText) -> Candidate:
        """Return the run that is made of ``kept``, judged by ``oracle`` alone.

        Raises :class:`InputError` or ``ValueError`` when they make no run: a layer speaks of
        objects that another one places, no waypoint is left.
        """
        scene, behaviours = self._world(kept)
        scene = with_objects(scene, {e.name for e in kept if e.kind == "object"})
        indices = [e.index for e in kept if e.kind == "waypoint"]
        mission = self.spec.mission
        waypoints = tuple(w for i, w in enumerate(mission.waypoints) if i in indices)
        if not waypoints:
            raise ValueError("no waypoint is left")
        names = {e.name for e in kept if e.kind == "behaviour"}
        surviving = Surviving(frozenset(scene.joint_names), tuple(sorted(indices)), waypoints)
        spec = dataclasses.replace(
            self.spec,
            scene=scene.digest,
            mission=dataclasses.replace(mission, waypoints=waypoints),
            behaviours=without_lost((b for b in behaviours if named(b) in names), surviving),
            sut=self.settings.sut(kept),
            oracles=(oracle,),
        )
        return Candidate(spec, scene)

    def _world(self, kept: Collection[Element]) -> tuple[Scene, tuple[Behaviour, ...]]:
        """Return the scene of the kept layers with everything in it, and what its joints do."""
        key = frozenset(e for e in kept if e.kind in ("objects", "behaviours", "override"))
        if key not in self._worlds:
            self._worlds[key] = self._composed(key)
        return self._worlds[key]

    def _composed(self, kept: frozenset[Element]) -> tuple[Scene, tuple[Behaviour, ...]]:
        used = [layer for layer in self.layers if layer.element in kept]
        layers = [_configured(layer, kept) for layer in used]
        objects = [
            layer for layer, use in zip(layers, used, strict=True) if use.element.kind == "objects"
        ]
        scene = compile_scene(self.cell.plan, objects)
        draw = self.spec.repeat if self.cell.scenario.chance == "per repeat" else 0
        seed = repeat_seed(self.campaign.seed, draw)
        found = resolve_behaviours(scene, layers, seed=seed, limit=self.spec.limit)
        return scene, found.behaviours


def _configured(layer: Layer, kept: Collection[Element]) -> SceneryLayer:
    wanted = {key: value for element, key, value in layer.overrides if element in kept}
    return configure(layer.plain, wanted, layer.reference.where)


def named(behaviour: Behaviour) -> str:
    """Return what people call a behaviour: its joint, or the mover that walks."""
    return behaviour.object if isinstance(behaviour, Walk) else behaviour.joint


def with_objects(scene: Scene, names: Collection[str]) -> Scene:
    """Return ``scene`` as if only the objects of these names had been put into it."""
    objects = tuple(thing for thing in scene.objects if thing.name in names)
    frames = scene.frames if _any_mover(objects) else ()
    return dataclasses.replace(scene, objects=objects, frames=frames)


def _any_mover(objects: Iterable[SceneObject]) -> bool:
    return any(is_mover(thing.joints) for thing in objects)


def load_case(path: Path, scenario: str, sut: str, repeat: int) -> Case:
    """Take a run of a campaign file apart.

    ``sut`` may be empty when the scenario has only one. Raises :class:`InputError` for what the
    campaign does not have.
    """
    campaign = load_campaign(path)
    cell = _cell(campaign, scenario)
    name = _sut(campaign, cell, sut)
    runs = expand(campaign).runs
    found = [r for r in runs if (r.scenario, r.sut.name, r.repeat) == (scenario, name, repeat)]
    if not found:
        message = f"{scenario} with {name} has no repeat {repeat}"
        raise InputError(Diagnostic(Where(campaign.file), message, "repeats count from 0"))
    library = Library(path.parent)
    return Case(
        campaign=campaign,
        cell=cell,
        folder=path.parent,
        spec=found[0],
        scene=cell.scene,
        layers=_layers(cell, library),
        settings=differences(cell, found[0].sut, path.parent, library),
    )


def _cell(campaign: Campaign, scenario: str) -> Cell:
    for cell in campaign.cells:
        if cell.name == scenario:
            return cell
    hint = did_you_mean(scenario, [cell.name for cell in campaign.cells])
    raise InputError(Diagnostic(Where(campaign.file), f'no scenario "{scenario}"', hint))


def _sut(campaign: Campaign, cell: Cell, name: str) -> str:
    names = [sut.name for sut in cell.suts]
    if not name and len(names) == 1:
        return names[0]
    if name in names:
        return name
    message = f'{cell.name} has no system under test "{name}"' if name else "which one of its SUTs?"
    raise InputError(Diagnostic(Where(campaign.file), message, did_you_mean(name, names)))


def _layers(cell: Cell, library: Library) -> tuple[Layer, ...]:
    scenario = cell.scenario
    found = []
    for index, reference in enumerate((*scenario.objects, *scenario.behaviours)):
        objects = index < len(scenario.objects)
        plain = library.scenery(reference)
        overrides = tuple(
            (Element("override", f"{plain.name}: {key} {value}", index), key, value)
            for key, value in reference.overrides.items()
        )
        element = Element("objects" if objects else "behaviours", plain.name, index)
        found.append(Layer(element, reference, plain, overrides))
    return tuple(found)
