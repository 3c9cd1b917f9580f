"""From a point of a search to its run: the scenario with the point's values, composed.

A search composes thousands of points that differ in a few values. What a point does not change is
loaded and composed once, so that one costs milliseconds; what comes out is what loading the found
campaign file gives, digest by digest.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeAlias, TypeVar

from daemon.analysis.blame import Candidate, RunCase, case_of
from daemon.campaign import (
    Campaign,
    CampaignCell,
    LayerLibrary,
    LayerReference,
    ResolvedScenario,
    load_campaign,
    noise_seed,
    repeat_seed,
)
from daemon.model.search import ParameterSlot, Point, SearchTask
from daemon.model.spec import OracleText, RunSpec
from grammars.floorplan import FloorPlan
from grammars.model.free_space import inscribed_radius
from grammars.model.scene import Scene
from grammars.scenery import SceneryLayer, configure
from grammars.scenery.composition import compile_scene, resolve_behaviours
from grammars.text.diagnostics import Diagnostic, InputError, Where, did_you_mean

T = TypeVar("T")
_MOST_KEPT: Final = 64
"""So many plans, scenes and loaded files are kept: those of repeats, and of points nearby."""
_Values: TypeAlias = Mapping[tuple[ParameterSlot, int], Mapping[str, object]]


class _Kept(dict[Hashable, Any]):
    """The latest of what was made, by what it was made of."""

    def once(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return what was made of ``key``, or make it now."""
        if key not in self:
            made = make()
            while len(self) >= _MOST_KEPT:
                del self[next(iter(self))]
            self[key] = made
        found: T = self[key]
        return found


@dataclass(slots=True)
class SearchCase:
    """A search with the campaign it is about, loaded once.

    ``cell`` is the scenario as written, ``sut`` the place of the searched system under test among
    those of the scenario.
    """

    task: SearchTask
    campaign: Campaign
    folder: Path
    cell: CampaignCell
    sut: int
    _library: LayerLibrary
    _oracles: tuple[OracleText, ...]
    _kept: _Kept = field(default_factory=_Kept)

    def candidate(self, point: Point, number: int, repeat: int = 0) -> Candidate:
        """Return the run of a point: ``repeat`` of proposal ``number``.

        Noise and chance are those that a scenario of the campaign has in that repeat. Raises
        :class:`InputError` for values that a layer refuses, or the geometry.
        """
        cell = self.cell_at(point, number, repeat)
        return Candidate(self._spec(cell, repeat), cell.scene)

    def run_case(self, point: Point, number: int) -> RunCase:
        """Return repeat 0 of a point taken apart, to find out what it can do without.

        Raises :class:`InputError` as :meth:`candidate` does.
        """
        cell = self.cell_at(point, number, 0)
        return case_of(self.campaign, cell, self._spec(cell, 0), self.folder)

    def scenario_at(self, point: Point, number: int) -> ResolvedScenario:
        """Return the scenario with the values of a point written beside its layers."""
        scenario = replace(self.cell.scenario, name=self.task.scenario_of(number))
        for (slot, index), values in self._values(point).items():
            scenario = _with_overrides(scenario, slot, index, values)
        return scenario

    def cell_at(self, point: Point, number: int, repeat: int) -> CampaignCell:
        """Return the loaded scenario of a point, with the behaviours of one repeat alone.

        Raises :class:`InputError` as :meth:`candidate` does.
        """
        scenario, library = self.scenario_at(point, number), self._library.branch()
        changed = {slot for slot, _ in self._values(point)}
        cell = self.cell
        robot, mission, suts = cell.robot, cell.mission, cell.suts
        if "robot" in changed:
            robot = self._loaded("robot", _one(scenario.robot), library.robot)
        if "mission" in changed:
            mission, _ = self._loaded("mission", _one(scenario.mission), library.mission)
        if "sut" in changed:
            made = self._loaded("sut", scenario.suts[self.sut], library.sut)
            suts = (*suts[: self.sut], made, *suts[self.sut + 1 :])
        variant, plan = self._plan(scenario, changed, inscribed_radius(robot.footprint))
        layers = self._layers(scenario, changed)
        objects = layers[: len(scenario.objects)]
        scene = self._scene(plan, objects)
        draw = repeat if scenario.chance == "per repeat" else 0
        resolved = resolve_behaviours(
            scene, layers, seed=repeat_seed(self.campaign.seed, draw), limit=scenario.limit
        )
        return replace(
            cell,
            name=scenario.name + variant,
            scenario=scenario,
            plan=plan,
            layers=layers,
            scene=scene,
            mission=mission,
            robot=robot,
            suts=suts,
            behaviours=(resolved.behaviours,),
        )

    def _values(self, point: Point) -> _Values:
        """Return the overrides of a point by the layers beside which they are written."""
        found: dict[tuple[ParameterSlot, int], dict[str, object]] = {}
        for parameter, value in zip(self.task.parameters, point, strict=True):
            layer = found.setdefault((parameter.slot, parameter.index), {})
            layer[parameter.key] = parameter.override(value)
        return found

    def _loaded(
        self, slot: str, reference: LayerReference, load: Callable[[LayerReference], T]
    ) -> T:
        """Load a layer with its overrides, unless one of the latest points had the same."""
        return self._kept.once((slot, repr(reference.overrides)), lambda: load(reference))

    def _plan(
        self, scenario: ResolvedScenario, changed: set[ParameterSlot], radius: float
    ) -> tuple[str, FloorPlan]:
        """Return the plan and what the name of its cell has behind that of the scenario."""
        vary = scenario.vary
        if vary is None:
            if "floorplan" not in changed:
                return "", self.cell.plan
            load = self._library.branch().floorplan
            return "", self._loaded("floorplan", _one(scenario.floorplan), load)
        if not changed & {"vary", "robot"}:
            return self.cell.name.removeprefix(self.cell.scenario.name), self.cell.plan
        draw = partial(self._library.branch().variants, vary, radius)
        variants = self._kept.once(("vary", radius, repr(vary.floorplan.overrides)), draw)
        if len(variants) != 1:
            message = f"{scenario.name} is run in {len(variants)} buildings, a search is about one"
            raise InputError(Diagnostic(vary.floorplan.where, message, "write samples: 1"))
        ((name, plan),) = variants
        return f"@{name.rpartition('_')[2]}", plan

    def _layers(
        self, scenario: ResolvedScenario, changed: set[ParameterSlot]
    ) -> tuple[SceneryLayer, ...]:
        if not changed & {"objects", "behaviours"}:
            return self.cell.layers
        references = (*scenario.objects, *scenario.behaviours)
        return tuple(
            configure(self._library.scenery(one), one.overrides, one.where) for one in references
        )

    def _scene(self, plan: FloorPlan, objects: Sequence[SceneryLayer]) -> Scene:
        own = self.cell.layers[: len(self.cell.scenario.objects)]
        if plan == self.cell.plan and tuple(objects) == own:
            return self.cell.scene
        key = (plan, tuple(objects))
        return self._kept.once(key, lambda: compile_scene(plan, objects))

    def _spec(self, cell: CampaignCell, repeat: int) -> RunSpec:
        return RunSpec(
            campaign=self.campaign.name,
            scenario=cell.name,
            sut=cell.suts[self.sut],
            repeat=repeat,
            scene=cell.scene.digest,
            robot=cell.robot,
            mission=cell.mission,
            behaviours=cell.behaviours[0],
            oracles=self._oracles,
            map=cell.map,
            seed=noise_seed(self.campaign.seed, repeat),
            limit=cell.limit,
        )


def _with_overrides(
    scenario: ResolvedScenario, slot: ParameterSlot, index: int, values: Mapping[str, object]
) -> ResolvedScenario:
    """Return a scenario with other values beside the ``index``-th layer name of a slot."""

    def changed(reference: LayerReference) -> LayerReference:
        return replace(reference, overrides={**reference.overrides, **values})

    if slot == "floorplan":
        return replace(scenario, floorplan=changed(_one(scenario.floorplan)))
    name = {"sut": "suts"}.get(slot, slot)
    references = list(getattr(scenario, name))
    references[index] = changed(references[index])
    changes: dict[str, Any] = {name: tuple(references)}
    return replace(scenario, **changes)


def load_search_case(campaign_file: Path, name: str, task: SearchTask | None = None) -> SearchCase:
    """Load a campaign and one of its searches; ``task`` takes the place of what the file asks.

    Raises :class:`InputError` for files that cannot be used and names that are none.
    """
    campaign = load_campaign(campaign_file)
    if task is None:
        named = {search.name: search for search in campaign.searches}
        if name not in named:
            hint = did_you_mean(name, named) or "write one: search:"
            raise InputError.at(Where(str(campaign_file)), f'no search "{name}" here', hint)
        task = named[name]
    return search_case(campaign, task)


def search_case(campaign: Campaign, task: SearchTask) -> SearchCase:
    """Return a search of a loaded campaign; raises :class:`InputError` if it has no such cell."""
    cells = [cell for cell in campaign.cells if cell.scenario.name == task.scenario]
    place = Where(campaign.file)
    if len(cells) != 1:
        raise InputError.at(place, f'no scenario "{task.scenario}" to search')
    (cell,) = cells
    names = [sut.name for sut in cell.suts]
    if task.sut not in names:
        raise InputError.at(place, f'{task.scenario} has no system under test "{task.sut}"')
    # Without what comparisons of scenarios measure: a search compares none.
    picked = {reference.name for reference in cell.scenario.oracles}
    oracles = tuple(OracleText(o.name, o.text) for o in cell.oracles if o.name in picked)
    folder = Path(campaign.file).parent
    return SearchCase(
        task=task,
        campaign=campaign,
        folder=folder,
        cell=cell,
        sut=names.index(task.sut),
        _library=LayerLibrary(folder),
        _oracles=oracles,
    )


def _one(reference: LayerReference | None) -> LayerReference:
    if reference is None:
        raise ValueError("a loaded scenario has no empty slot")
    return reference
