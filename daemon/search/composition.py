"""Composition of the runs of a search: the scenario with the values of a point.

A search composes thousands of points that differ in a few values. Unchanged parts are loaded and
composed once, so a point costs milliseconds. The runs have the same digests as those of the found
campaign file.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from daemon.campaign import (
    Campaign,
    CampaignCell,
    Composer,
    LayerLibrary,
    ResolvedScenario,
    campaign_text,
    run_spec,
    with_overrides,
)
from daemon.model.search import Point, SearchTask
from daemon.model.spec import OracleText, RunSpec
from daemon.search.points import is_as_written
from grammars.text.diagnostics import InputError, Where

if TYPE_CHECKING:
    from daemon.analysis.blame import Candidate, RunCase
    from daemon.model.trials import Trial


@dataclass(slots=True)
class SearchCase:
    """A search with its campaign, loaded once.

    ``cell`` is the scenario as written, ``sut`` the index of its system under test in the search.
    """

    task: SearchTask
    campaign: Campaign
    folder: Path
    cell: CampaignCell
    sut: int
    _composer: Composer
    _oracles: tuple[OracleText, ...]

    def candidate(self, point: Point, number: int, repeat: int = 0) -> Candidate:
        """Return the run of a point: ``repeat`` of proposal ``number``.

        Noise and chance are those of this repeat in the campaign. Raises :class:`InputError` for
        values that a layer or the geometry refuses.
        """
        # This loads the code that executes runs; a check only composes points.
        from daemon.analysis.blame import Candidate

        cell = self.cell_at(point, number, repeat)
        return Candidate(self._spec(cell, repeat), cell.scene)

    def run_case(self, point: Point, number: int) -> RunCase:
        """Return repeat 0 of a point, ready for the removal of unneeded parts.

        Raises :class:`InputError` as :meth:`candidate` does.
        """
        from daemon.analysis.blame import case_of

        cell = self.cell_at(point, number, 0)
        return case_of(self.campaign, cell, self._spec(cell, 0), self.folder)

    def found_text(self, result: Trial, *, comment: str, why: str = "") -> str:
        """Return a campaign file, for the same folder, with the scenario of a point alone.

        Its runs have the digests of the proposal's, and it has only changed values. ``comment``
        stands above it. With ``why`` its oracle is expected to fail.
        """
        expected: list[dict[str, str]] = []
        if why and result.fails and result.verdict is not None:
            expected.append({"oracle": result.verdict.oracle, "verdict": "fail", "why": why})
        return campaign_text(
            self.campaign,
            self._found_scenario(result.point, result.number),
            name=self.task.scenario_of(result.number),
            expect=expected,
            sut=self.sut,
            about=f"Found by the search {self.task.name} of {self.campaign.name}.",
            comment=comment,
        )

    def _scenario_at(
        self, point: Point, number: int, *, only_changed: bool = False
    ) -> ResolvedScenario:
        """Return the scenario with the values of a point, or ``only_changed`` ones."""
        scenario = replace(self.cell.scenario, name=self.task.scenario_of(number))
        for parameter, value in zip(self.task.parameters, point, strict=True):
            if not (only_changed and is_as_written(parameter, value)):
                override = {parameter.key: parameter.override(value)}
                scenario = with_overrides(scenario, parameter.slot, parameter.index, override)
        return scenario

    def _found_scenario(self, point: Point, number: int) -> ResolvedScenario:
        """Return the shortest scenario of a point that has the same run."""
        short = self._scenario_at(point, number, only_changed=True)
        digest = self._spec(self._composer.cell(self.cell, short, 0), 0).digest
        # A written value may have more digits than a value of a point, and give another run.
        is_same = digest == self._spec(self.cell_at(point, number, 0), 0).digest
        return short if is_same else self._scenario_at(point, number)

    def cell_at(self, point: Point, number: int, repeat: int) -> CampaignCell:
        """Return the loaded scenario of a point, with the behaviours of one repeat alone.

        Raises :class:`InputError` as :meth:`candidate` does.
        """
        return self._composer.cell(self.cell, self._scenario_at(point, number), repeat)

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
    place = Where(campaign.file)
    cell = next((one for one in campaign.cells if one.scenario.name == task.scenario), None)
    if cell is None:
        raise InputError.at(place, f'no scenario "{task.scenario}" to search')
    names = [sut.name for sut in cell.suts]
    if task.sut not in names:
        raise InputError.at(place, f'{task.scenario} has no system under test "{task.sut}"')
    for parameter in task.parameters:
        try:
            with_overrides(cell.scenario, parameter.slot, parameter.index, {})
        except ValueError as error:
            # A task of an earlier submission may belong to another file.
            raise InputError.at(place, f"{parameter.name}: {error}") from error
    # The cell also has the measures of comparisons, which a search does not need.
    own = set(cell.scenario.oracle_names)
    oracles = tuple(OracleText(o.name, o.text) for o in cell.oracles if o.name in own)
    folder = Path(campaign.file).parent
    return SearchCase(
        task=task,
        campaign=campaign,
        folder=folder,
        cell=cell,
        sut=names.index(task.sut),
        _composer=Composer(LayerLibrary(folder), campaign.seed),
        _oracles=oracles,
    )
