"""A campaign file loaded with every layer it names: composed to cells, and checked.

One bad layer, scenario or variant of a plan does not hide what is wrong with the next.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TypeVar

from daemon.campaign._campaign import (
    EXTERNAL_REPEATS,
    Campaign,
    default_repeats,
)
from daemon.campaign._cells import (
    CampaignCell,
    LoadedWorld,
    placed_alone,
    repeated_layers,
    sound_part,
    waypoint_places,
)
from daemon.campaign._composer import Composer, RemainingWorld, leave_out
from daemon.campaign._declarations import DeclarationScope, LegTimings, read_declarations
from daemon.campaign._file import CampaignFile, repeat_policy
from daemon.campaign._findings import (
    allowed_warnings,
    find_problems,
    find_unmet,
    say_once,
    without_allowed,
)
from daemon.campaign._layers import LayerLibrary
from daemon.campaign._scenarios import LayerReference, ResolvedScenario, limit_place, pick_oracles
from daemon.campaign._searches import SearchScope, read_searches
from daemon.campaign._survey import survey_campaign
from daemon.campaign._unused import CampaignUse, find_unused
from daemon.model.assessments import AssessmentRules
from daemon.model.spec import SutReference
from daemon.model.submission import MOST_RUNS, too_many_runs
from grammars.floorplan import FloorPlan
from grammars.model.free_space import inscribed_radius
from grammars.model.robot import Robot
from grammars.model.scene import Scene
from grammars.oracle import Oracle, check_joint_limits, check_references
from grammars.preflight import places_of
from grammars.scenery import SceneryLayer
from grammars.scenery.composition import ResolvedBehaviours
from grammars.text.diagnostics import Diagnostic, InputError, Severity
from grammars.text.documents import YamlDocument, load_yaml

T = TypeVar("T")


@dataclass(slots=True)
class _CampaignLoader:
    """A campaign while it is loaded; one bad layer does not hide what is wrong with another."""

    document: YamlDocument
    text: CampaignFile
    library: LayerLibrary
    composer: Composer
    findings: list[Diagnostic] = field(default_factory=list)
    worlds: list[LoadedWorld] = field(default_factory=list)
    cells: list[CampaignCell] = field(default_factory=list)
    partial: list[CampaignCell] = field(default_factory=list)
    """Cells that no run is made of, since part of what they name cannot be used."""
    lost: list[tuple[SutReference | None, ...]] = field(default_factory=list)

    def collect_errors(self, make: Callable[[], T]) -> T | None:
        """Return what ``make`` returns, or ``None`` when it reports bad input."""
        try:
            return make()
        except InputError as error:
            self.findings.extend(error.diagnostics)
            return None


def load_campaign(path: str | Path) -> Campaign:
    """Load a campaign file and every layer it names.

    Raises :class:`InputError` with the problems of all layers at once.
    """
    campaign, loader = _load_all(path)
    if loader.findings:
        raise InputError(dict.fromkeys(loader.findings))
    return campaign


def examine(path: str | Path) -> tuple[Campaign, tuple[Diagnostic, ...]]:
    """Load a campaign as far as it goes and return it with everything there is to say about it.

    Unlike :func:`load_campaign` it goes on after a bad layer: what the pre-flight finds in sound
    scenarios is reported together with what cannot be read. Raises :class:`InputError` only when
    the campaign file itself cannot be understood.
    """
    campaign, loader = _load_all(path)
    preflight = find_problems(loader.worlds, (*campaign.cells, *loader.partial))
    said, meant = without_allowed(preflight, campaign.allow)
    found = (*loader.findings, *campaign.warnings, *said)
    campaign = replace(campaign, allowed=say_once((*campaign.allowed, *meant)))
    # What could not be read may be what is allowed.
    whole = not any(one.severity is Severity.ERROR for one in found)
    unmet = find_unmet(campaign.allow, campaign.allowed) if whole else ()
    return campaign, say_once((*found, *unmet))


def check(campaign: Campaign) -> tuple[Diagnostic, ...]:
    """Return warnings of the layers and what the pre-flight of every cell finds."""
    problems, _ = without_allowed(find_problems(campaign.cells, campaign.cells), campaign.allow)
    return say_once((*campaign.warnings, *problems))


def _load_all(path: str | Path) -> tuple[Campaign, _CampaignLoader]:
    document = load_yaml(path)
    survey = survey_campaign(document)
    text, scenarios = survey.text, survey.scenarios
    library = LayerLibrary(Path(path).parent)
    loader = _CampaignLoader(document, text, library, Composer(library, text.seed))
    loader.findings += survey.problems
    _refuse_too_many(scenarios, loader)
    pool = loader.collect_errors(lambda: loader.library.oracles(_oracle_layers(text, document)))
    # What was left out of the file is not to be missed a second time.
    if survey.lost and text.oracles is None:
        pool = None
    declared = AssessmentRules(repeat_policy(text.repeats))
    if pool is not None and not survey.lost and not survey.incomplete:
        named = {scenario.name: scenario for scenario in scenarios}
        declared, problems = read_declarations(DeclarationScope(text, document, named, pool))
        loader.findings += problems
    for scenario in scenarios:
        timed = tuple(c for c in declared.comparisons if scenario.name in (c.left, c.right))
        timings = LegTimings(timed, document)
        _load_cells(scenario, loader, pool, timings, whole=scenario.name not in survey.incomplete)
    use = CampaignUse(text, document, scenarios, loader.worlds, not loader.findings)
    searches, said = read_searches(
        SearchScope(
            text,
            document,
            loader.library,
            {scenario.name: scenario for scenario in scenarios},
            loader.cells,
            survey.unread_searches,
            frozenset(pool or ()),
        )
    )
    loader.findings += [one for one in said if one.severity is Severity.ERROR]
    unused = find_unused(
        use, lambda layer: loader.collect_errors(lambda: loader.library.oracles((layer,)))
    )
    allow = allowed_warnings(text, document)
    warnings, meant = without_allowed(
        (
            *loader.library.warnings,
            *_announce_repeats((sut for cell in loader.cells for sut in cell.suts), document),
            *unused,
            *(one for one in said if one.severity is Severity.WARNING),
        ),
        allow,
    )
    campaign = Campaign(
        name=text.campaign,
        about=text.about,
        source=document.text,
        file=str(path),
        seed=text.seed,
        repeats=declared.policy.n if "repeats" in document.data else None,
        declared=declared,
        cells=tuple(loader.cells),
        warnings=say_once(warnings),
        lost=tuple(loader.lost),
        searches=searches,
        allow=allow,
        allowed=tuple(meant),
    )
    return campaign, loader


def _refuse_too_many(scenarios: Sequence[ResolvedScenario], loader: _CampaignLoader) -> None:
    """Refuse a campaign with more runs than the daemon takes, before their behaviours are drawn."""
    cells = sum(
        len(scenario.suts) * (scenario.vary.samples or 1 if scenario.vary else 1)
        for scenario in scenarios
    )
    count = cells * repeat_policy(loader.text.repeats).at_most
    if count > MOST_RUNS:
        where = loader.document.where(("repeats",))
        raise InputError((*loader.findings, Diagnostic(where, too_many_runs(count))))


def _oracle_layers(text: CampaignFile, document: YamlDocument) -> tuple[LayerReference, ...]:
    names = text.oracles or []
    return tuple(
        LayerReference(name, {}, document.where(("oracles", i))) for i, name in enumerate(names)
    )


def _load_cells(
    scenario: ResolvedScenario,
    loader: _CampaignLoader,
    pool: dict[str, Oracle] | None,
    timed: LegTimings,
    *,
    whole: bool,
) -> None:
    """Add the cells of a scenario: one, or one for each variant of its floor plan.

    A scenario that is not ``whole`` lacks keys that could not be read.
    """
    attempt, library = loader.collect_errors, loader.library
    robot = attempt(partial(library.robot, scenario.robot)) if scenario.robot else None
    loaded = attempt(partial(library.mission, scenario.mission)) if scenario.mission else None
    suts = [attempt(partial(library.sut, reference)) for reference in scenario.suts]
    loader.findings += _same_names(scenario, suts)
    named = scenario.map_file
    given = attempt(partial(library.map, named)) if named else None
    picked = (
        () if pool is None else attempt(lambda: pick_oracles(scenario, pool, loader.text)) or ()
    )
    oracles = (*picked, *timed.measures())
    if loaded is not None:
        loader.findings += timed.problems(loaded[0])
    known = tuple(sut for sut in suts if sut is not None)
    worlds = _load_worlds(scenario, robot, known, loader, whole=whole)
    loader.lost += [tuple(suts)] * (not worlds)
    for world in worlds:
        if robot is None or loaded is None:
            loader.lost.append(tuple(suts))
            continue
        mission, document = loaded
        behaviours = tuple(r.behaviours for r in world.resolved) or ((),)
        composed = RemainingWorld(world.scene, mission, behaviours)
        remains = composed
        if world.whole:
            remains = attempt(partial(leave_out, scenario.without, composed)) or composed
        named_in = remains.scene if world.whole else world.named
        if named_in is not None:
            for oracle in picked:
                loader.findings += check_references(oracle, named_in, remains.mission)
                library.warnings.extend(check_joint_limits(oracle, named_in))
        cell = CampaignCell(
            name=world.name,
            scenario=scenario,
            plan=world.plan,
            layers=world.layers,
            scene=remains.scene,
            mission=remains.mission,
            mission_where=document.where(),
            places=dict(world.places) | waypoint_places(mission, document),
            robot=robot,
            suts=known,
            oracles=oracles,
            behaviours=remains.behaviours,
            map=given.settings if given else scenario.map,
            limit=scenario.limit,
            limit_where=limit_place(scenario.name, loader.text, loader.document),
            given_map=given.grid if given else None,
        )
        unusable = not world.whole or (named is not None and given is None)
        (loader.partial if unusable else loader.cells).append(cell)
        loader.lost += [tuple(suts)] * unusable


def _same_names(
    scenario: ResolvedScenario, suts: Sequence[SutReference | None]
) -> Iterator[Diagnostic]:
    """Yield systems under test that are called alike and are not the same: overrides keep names."""
    first: dict[str, SutReference] = {}
    for reference, sut in zip(scenario.suts, suts, strict=True):
        if sut is not None and first.setdefault(sut.name, sut) != sut:
            message = f'two systems under test of "{scenario.name}" are called {sut.name}'
            hint = f"give one a file of its own: suts/NAME.yaml with like: {reference.name}"
            yield Diagnostic(reference.where, f"{message} and differ", hint)


def _load_worlds(
    scenario: ResolvedScenario,
    robot: Robot | None,
    suts: tuple[SutReference, ...],
    loader: _CampaignLoader,
    *,
    whole: bool,
) -> list[LoadedWorld]:
    """Return the worlds of a scenario; empty when it has no floor plan that can be used.

    Where another layer cannot be used a world is what can be said without it.
    """
    attempt, library = loader.collect_errors, loader.library
    plans = attempt(lambda: _plans(scenario, robot, library)) or []
    references = (*scenario.objects, *scenario.behaviours)
    layers = [attempt(partial(library.configured_scenery, reference)) for reference in references]
    again = repeated_layers(scenario, layers)
    loader.findings += again.values()
    sound = tuple(layer for n, layer in enumerate(layers) if layer is not None and n not in again)
    objects = layers[: len(scenario.objects)]
    count = len(objects) - sum(n < len(objects) for n in again)
    # Without one of its layers an object would be missed that is only written elsewhere.
    known = whole and None not in objects
    usable = sound[:count] if known else ()
    whole = known and None not in layers
    repeats = repeat_policy(loader.text.repeats).at_most
    if "repeats" not in loader.document.data:
        repeats = default_repeats(suts)
    # One variant that cannot be composed does not hide what is wrong with the next.
    worlds = []
    for name, plan in plans:
        resolve = partial(_behaviours, scenario, repeats, sound, loader.composer)
        scene = attempt(partial(loader.composer.scene, plan, sound[:count])) if whole else None
        if scene is None:
            # The building, the mission and the objects that stand can still be looked at.
            part = sound_part(name, plan, usable, known=known)
            told = attempt(partial(resolve, part.named)) if whole and part.named else None
            if told is not None:
                places = dict(part.places) | dict(told[0].places)
                part = replace(part, resolved=placed_alone(told, part.scene), places=places)
            worlds.append(part)
            continue
        places = places_of(sound, plan)
        resolved = attempt(partial(resolve, scene))
        if resolved is None:
            worlds.append(LoadedWorld(name, plan, sound, scene, (), places, False, scene))
            continue
        library.warnings.extend(resolved[0].overridden)
        places |= dict(resolved[0].places)
        worlds.append(LoadedWorld(name, plan, sound, scene, resolved, places, named=scene))
    loader.worlds += worlds
    return worlds


def _plans(
    scenario: ResolvedScenario, robot: Robot | None, library: LayerLibrary
) -> list[tuple[str, FloorPlan]]:
    """Return the floor plans of a scenario with the names of their cells.

    A variant of the plan drawn with seed 1003 makes the cell ``<scenario>@1003``.
    """
    if scenario.vary is None:
        named = scenario.floorplan
        return [(scenario.name, library.floorplan(named))] if named else []
    if robot is None:
        return []
    variants = library.variants(scenario.vary, inscribed_radius(robot.footprint))
    return [(f"{scenario.name}@{name.rpartition('_')[2]}", plan) for name, plan in variants]


def _behaviours(
    scenario: ResolvedScenario,
    repeats: int,
    layers: tuple[SceneryLayer, ...],
    composer: Composer,
    scene: Scene,
) -> tuple[ResolvedBehaviours, ...]:
    return composer.behaviours(scenario, scene, layers, range(repeats))


def _announce_repeats(suts: Iterable[SutReference], document: YamlDocument) -> Iterator[Diagnostic]:
    """Say how often cells are run whose system is not repeatable, where nobody said it."""
    names = dict.fromkeys(sut.name for sut in suts if not sut.repeatable)
    if names and "repeats" not in document.data:
        message = (
            f"{', '.join(names)}: not repeatable, so every scenario is run {EXTERNAL_REPEATS} "
            "times with it; the campaign does not say how often"
        )
        where = document.where(("matrix", "sut"))
        hint = f'write "repeats: {EXTERNAL_REPEATS}" for all systems, or another number'
        yield Diagnostic(where, message, hint, Severity.WARNING)
