"""From a point of a search to its run: the scenario with the point's values, composed.

A search composes thousands of points that differ in a few values. What a point does not change is
loaded and composed once, so that one costs milliseconds; what comes out is what loading the found
campaign file gives, digest by digest.
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
    """A search with the campaign it is about, loaded once.

    ``cell`` is the scenario as written, ``sut`` the place of the searched system under test among
    those of the scenario.
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

    def scenario_at(
        self, point: Point, number: int, *, only_changed: bool = False
    ) -> ResolvedScenario:
        """Return the scenario with the values of a point written beside its layers.

        With ``only_changed`` those that are as written are left out.
        """
        scenario = replace(self.cell.scenario, name=self.task.scenario_of(number))
        for parameter, value in zip(self.task.parameters, point, strict=True):
            written = parameter.written is not None and is_as_written(parameter, value)
            if not (only_changed and written):
                override = {parameter.key: parameter.override(value)}
                scenario = with_overrides(scenario, parameter.slot, parameter.index, override)
        return scenario

    def _found_scenario(self, point: Point, number: int) -> ResolvedScenario:
        """Return the scenario of a point that says what is not as written, and the same run."""
        scenarios = [self.scenario_at(point, number, only_changed=one) for one in (True, False)]
        cells = (self._composer.cell(self.cell, one, 0) for one in scenarios)
        digests = [self._spec(cell, 0).digest for cell in cells]
        # Written with more digits than a value of a point has, say, it would be another run.
        return scenarios[0] if digests[0] == digests[1] else scenarios[1]

    def cell_at(self, point: Point, number: int, repeat: int) -> CampaignCell:
        """Return the loaded scenario of a point, with the behaviours of one repeat alone.

        Raises :class:`InputError` as :meth:`candidate` does.
        """
        return self._composer.cell(self.cell, self.scenario_at(point, number), repeat)

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
        _composer=Composer(LayerLibrary(folder), campaign.seed),
        _oracles=oracles,
    )
