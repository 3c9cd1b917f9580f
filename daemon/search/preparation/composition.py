"""From a point of a search to its run: the scenario with the point's values, composed.

A search composes thousands of points that differ in a few values. What a point does not change is
loaded and composed once, so that one costs milliseconds; what comes out is what loading the found
campaign file gives, digest by digest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeAlias

from daemon.campaign import (
    Campaign,
    CampaignCell,
    LayerLibrary,
    LayerReference,
    ResolvedScenario,
    campaign_text,
    repeat_seed,
    run_spec,
    with_overrides,
)
from daemon.model.search import ParameterSlot, Point, SearchTask
from daemon.model.spec import OracleText, RunSpec
from daemon.search.points import is_as_written
from grammars.floorplan import FloorPlan
from grammars.model.free_space import inscribed_radius
from grammars.model.scene import Scene
from grammars.scenery import SceneryLayer
from grammars.scenery.composition import compile_scene, resolve_behaviours
from grammars.text.diagnostics import Diagnostic, InputError, Where

if TYPE_CHECKING:
    from daemon.analysis.blame import Candidate, RunCase
    from daemon.model.trials import Trial

_MOST_SCENES: Final = 64
"""So many scenes are kept: those of repeats, and of points nearby."""
_Values: TypeAlias = Mapping[tuple[ParameterSlot, int], Mapping[str, object]]


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
    _scenes: dict[tuple[FloorPlan, tuple[SceneryLayer, ...]], Scene] = field(default_factory=dict)

    def candidate(self, point: Point, number: int, repeat: int = 0) -> Candidate:
        """Return the run of a point: ``repeat`` of proposal ``number``.

        Noise and chance are those that a scenario of the campaign has in that repeat. Raises
        :class:`InputError` for values that a layer refuses, or the geometry.
        """
        # What executes runs is loaded for that: who only checks a search composes its points.
        from daemon.analysis.blame import Candidate

        cell = self.cell_at(point, number, repeat)
        return Candidate(self._spec(cell, repeat), cell.scene)

    def run_case(self, point: Point, number: int) -> RunCase:
        """Return repeat 0 of a point taken apart, to find out what it can do without.

        Raises :class:`InputError` as :meth:`candidate` does.
        """
        from daemon.analysis.blame import case_of

        cell = self.cell_at(point, number, 0)
        return case_of(self.campaign, cell, self._spec(cell, 0), self.folder)

    def found_text(self, result: Trial, *, comment: str, why: str = "") -> str:
        """Return a campaign file beside that of the campaign with the scenario of a point alone.

        Its runs are those of the proposal, digest by digest, and it says only what is not as
        written. ``comment`` stands above it. What fails is expected to, where ``why`` is given.
        """
        point, number = result.point, result.number
        expected: list[dict[str, str]] = []
        if why and result.fails and result.verdict is not None:
            expected.append({"oracle": result.verdict.oracle, "verdict": "fail", "why": why})
        return campaign_text(
            self.campaign,
            self._found_scenario(point, number),
            name=self.task.scenario_of(number),
            expect=expected,
            sut=self.sut,
            about=f"Found by the search {self.task.name} of {self.campaign.name}.",
            comment=comment,
        )

    def scenario_at(self, point: Point, number: int) -> ResolvedScenario:
        """Return the scenario with the values of a point written beside its layers."""
        return self._with_values(self._values(point), number)

    def _with_values(self, values: _Values, number: int) -> ResolvedScenario:
        scenario = replace(self.cell.scenario, name=self.task.scenario_of(number))
        for (slot, index), found in values.items():
            scenario = with_overrides(scenario, slot, index, found)
        return scenario

    def _found_scenario(self, point: Point, number: int) -> ResolvedScenario:
        """Return the scenario of a point that says what is not as written, and the same run."""
        whole = self.scenario_at(point, number)
        told = self._with_values(self._values(point, only_changed=True), number)
        runs = [self._spec(self._composed(one, point, 0), 0) for one in (whole, told)]
        # Written with more digits than a value of a point has, say, it would be another run.
        return told if runs[0].digest == runs[1].digest else whole

    def cell_at(self, point: Point, number: int, repeat: int) -> CampaignCell:
        """Return the loaded scenario of a point, with the behaviours of one repeat alone.

        Raises :class:`InputError` as :meth:`candidate` does.
        """
        return self._composed(self.scenario_at(point, number), point, repeat)

    def _composed(self, scenario: ResolvedScenario, point: Point, repeat: int) -> CampaignCell:
        library = self._library
        # Those of the scenario as written have been told; of every point they would pile up.
        library.warnings.clear()
        changed = {parameter.slot for parameter in self.task.parameters}
        cell = self.cell
        robot, mission, suts = cell.robot, cell.mission, cell.suts
        if "robot" in changed:
            robot = library.robot(_one(scenario.robot))
        if "mission" in changed:
            mission, _ = library.mission(_one(scenario.mission))
        if "sut" in changed:
            made = library.sut(scenario.suts[self.sut])
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

    def _values(self, point: Point, *, only_changed: bool = False) -> _Values:
        """Return the overrides of a point by the layers beside which they are written.

        Or those alone that are not as written, and those that are written nowhere.
        """
        found: dict[tuple[ParameterSlot, int], dict[str, object]] = {}
        for parameter, value in zip(self.task.parameters, point, strict=True):
            written = parameter.written is not None and is_as_written(parameter, value)
            if only_changed and written:
                continue
            layer = found.setdefault((parameter.slot, parameter.index), {})
            layer[parameter.key] = parameter.override(value)
        return found

    def _plan(
        self, scenario: ResolvedScenario, changed: set[ParameterSlot], radius: float
    ) -> tuple[str, FloorPlan]:
        """Return the plan and what the name of its cell has behind that of the scenario."""
        vary = scenario.vary
        if vary is None:
            if "floorplan" not in changed:
                return "", self.cell.plan
            return "", self._library.floorplan(_one(scenario.floorplan))
        if not changed & {"vary", "robot"}:
            return self.cell.name.removeprefix(self.cell.scenario.name), self.cell.plan
        variants = self._library.variants(vary, radius)
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
        return tuple(map(self._library.configured_scenery, references))

    def _scene(self, plan: FloorPlan, objects: Sequence[SceneryLayer]) -> Scene:
        own = self.cell.layers[: len(self.cell.scenario.objects)]
        if plan == self.cell.plan and tuple(objects) == own:
            return self.cell.scene
        key = (plan, tuple(objects))
        if key not in self._scenes:
            scene = compile_scene(plan, objects)
            while len(self._scenes) >= _MOST_SCENES:
                del self._scenes[next(iter(self._scenes))]
            self._scenes[key] = scene
        return self._scenes[key]

    def _spec(self, cell: CampaignCell, repeat: int) -> RunSpec:
        return run_spec(
            self.campaign,
            cell,
            cell.suts[self.sut],
            repeat,
            behaviours=cell.behaviours[0],
            oracles=self._oracles,
            scene=cell.scene.digest,
        )


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
    for parameter in task.parameters:
        try:
            with_overrides(cell.scenario, parameter.slot, parameter.index, {})
        except ValueError as error:
            # A task that comes from elsewhere may be of another file.
            raise InputError.at(place, f"{parameter.name}: {error}") from error
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
