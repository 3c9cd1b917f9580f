"""Loading of a campaign file with all its layers, in stages that build on each other.

The stages read the file, resolve its scenarios, load layers, compose cells, and read declarations
and searches; :func:`examine` then runs the pre-flight. A stage reports all its errors at once; the
next one begins only without errors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

from daemon.campaign._campaign import EXTERNAL_REPEATS, Campaign, default_repeats
from daemon.campaign._composer import Composer, leave_out
from daemon.campaign._declarations import read_declarations, time_legs
from daemon.campaign._file import CampaignFile, repeat_policy
from daemon.campaign._findings import (
    allowed_warnings,
    find_doubts,
    find_problems,
    find_unmet,
    find_unused,
    say_once,
    without_allowed,
)
from daemon.campaign._layers import CampaignCell, Draft, LayerLibrary
from daemon.campaign._scenarios import (
    LayerReference,
    ResolvedScenario,
    limit_place,
    pick_oracles,
    required,
    resolve_scenarios,
)
from daemon.campaign._searches import read_searches
from daemon.model.spec import SutReference
from daemon.model.submission import MOST_RUNS, too_many_runs
from grammars.floorplan import FloorPlan
from grammars.model.free_space import inscribed_radius
from grammars.oracle import check_references
from grammars.preflight import places_of
from grammars.text.diagnostics import Finding, InputError, Severity, Where, gather, raise_all
from grammars.text.documents import YamlDocument, load_yaml, read_model
from grammars.text.file_kinds import kind_of_name, refuse_kind


def examine(path: str | Path) -> tuple[Campaign, tuple[Finding, ...]]:
    """Load a campaign; return it with its warnings and all findings of the pre-flight.

    Raises :class:`InputError` as :func:`load_campaign` does.
    """
    return check_campaign(load_campaign(path))


def check_campaign(
    campaign: Campaign, *, selected: bool = False
) -> tuple[Campaign, tuple[Finding, ...]]:
    """Return a campaign with its warnings and all findings of the pre-flight.

    A campaign of ``selected`` cells need not have every warning that its file allows.
    """
    problems, allowed = without_allowed(find_problems(campaign.cells), campaign.allow)
    campaign = replace(campaign, allowed=say_once((*campaign.allowed, *allowed)))
    unmet = () if selected else find_unmet(campaign.allow, campaign.allowed)
    return campaign, say_once((*campaign.warnings, *problems, *unmet))


def load_campaign(path: str | Path, *, system: str = "") -> Campaign:
    """Load a campaign file and all its layers.

    ``system``, the name or path of a system under test, replaces those of every scenario; the
    searches are left out then. Raises :class:`InputError` with all problems of the first stage that
    has any.
    """
    refuse_kind(kind_of_name(str(path)), Where(str(path)))
    document = load_yaml(path)
    text = read_model(document, CampaignFile)
    originals = resolve_scenarios(text, document)
    scenarios = dict(originals)
    if system:
        instead = LayerReference(system, {}, Where(f"system {system}"))
        scenarios = {name: replace(one, suts=(instead,)) for name, one in originals.items()}
    draft = Draft(text, document, LayerLibrary(Path(path).parent), scenarios)
    allow = allowed_warnings(text, document)
    others = (w for w in draft.library.warnings if not any(one.covers(w) for one in allow))
    with InputError.keeping(others):
        _refuse_too_many(draft)
        draft = _with_layers(draft)
        draft = replace(draft, cells=_compose_cells(draft))
        # Check the declarations against the systems in the file, not against ``system``.
        declared, problems = read_declarations(replace(draft, scenarios=originals))
        searches, findings = ((), ()) if system else read_searches(draft)
        problems += [one for one in findings if one.severity is Severity.ERROR]
        timed = [time_legs(cell, declared, document) for cell in draft.cells]
        raise_all((*problems, *(problem for _, wrong in timed for problem in wrong)))
        cells = tuple(cell for cell, _ in timed)
        warnings, allowed = without_allowed(
            (
                *draft.library.warnings,
                *_announce_repeats((sut for cell in cells for sut in cell.suts), document),
                *find_unused(draft),
                *find_doubts(draft, declared.policy),
                *findings,
            ),
            allow,
        )
        return Campaign(
            name=text.campaign,
            about=text.about,
            source=document.text,
            file=str(path),
            seed=text.seed,
            repeats=declared.policy.n if "repeats" in document.data else None,
            declared=declared,
            oracle_layers=tuple(text.oracles or ()),
            cells=cells,
            warnings=say_once(warnings),
            searches=searches,
            allow=allow,
            allowed=tuple(allowed),
        )


def _refuse_too_many(draft: Draft) -> None:
    """Refuse a campaign with more runs than the daemon takes, before drawing behaviours."""
    cells = sum(
        len(scenario.suts) * (scenario.vary.samples or 1 if scenario.vary else 1)
        for scenario in draft.scenarios.values()
    )
    count = cells * repeat_policy(draft.text.repeats).at_most
    if count > MOST_RUNS:
        raise InputError.at(draft.document.where(("repeats",)), too_many_runs(count))


def _with_layers(draft: Draft) -> Draft:
    """Load every layer of a campaign once and return the campaign with its oracles."""
    names, document = draft.text.oracles or [], draft.document
    files = tuple(
        LayerReference(name, {}, document.where(("oracles", i))) for i, name in enumerate(names)
    )
    scenarios = draft.scenarios.values()
    gather(load for scenario in scenarios for load in _layer_loads(scenario, files, draft))
    return replace(draft, oracles=draft.library.oracles(files))


def _layer_loads(
    scenario: ResolvedScenario, oracle_files: tuple[LayerReference, ...], draft: Draft
) -> Iterator[Callable[[], object]]:
    """Yield a loader for each layer of a scenario; the library caches them for later stages."""
    library = draft.library
    yield lambda: pick_oracles(scenario, library.oracles(oracle_files), draft.text)
    yield partial(library.robot, required(scenario.robot))
    yield partial(library.mission, required(scenario.mission))
    yield from (partial(library.sut, reference) for reference in scenario.suts)
    if scenario.map_file is not None:
        yield partial(library.map, scenario.map_file)
    yield partial(_plans, scenario, library)
    for reference in (*scenario.objects, *scenario.behaviours):
        yield partial(library.configured_scenery, reference)
    yield partial(_check_names, scenario, library)


def _check_names(scenario: ResolvedScenario, library: LayerLibrary) -> None:
    """Refuse different systems of one name, and layers with objects that are named twice."""
    problems = []
    systems: dict[str, SutReference] = {}
    for reference in scenario.suts:
        sut = library.sut(reference)
        if sut.name not in systems:
            systems[sut.name] = sut
        elif systems[sut.name] == sut:
            hint = "name it once; repeats: N runs it more often"
            problems.append(Finding(reference.where, f"{sut.name} is named twice", hint))
        else:
            # Overrides keep the name.
            message = f'two systems under test of "{scenario.name}" are called {sut.name}'
            hint = f"give one a file of its own: suts/NAME.yaml with like: {reference.name}"
            problems.append(Finding(reference.where, f"{message} and differ", hint))
    count = len(scenario.objects)
    first: dict[str, int] = {}
    for number, reference in enumerate((*scenario.objects, *scenario.behaviours)):
        layer = library.scenery(reference)
        # A layer with behaviours alone may be repeated, to win over the layers in between.
        is_first = first.setdefault(layer.file, number) == number
        if is_first or not (layer.models or layer.instances):
            continue
        under_both = first[layer.file] < count <= number
        places = "under objects and behaviours" if under_both else "twice"
        message = f"{reference.name} is named {places}"
        hint = "name it once, under objects: its behaviours hold as well"
        problems.append(Finding(reference.where, message, hint))
    raise_all(problems)


def _plans(scenario: ResolvedScenario, library: LayerLibrary) -> tuple[tuple[str, FloorPlan], ...]:
    """Return the floor plans of a scenario with the names of their cells.

    A variant of the plan drawn with seed 1003 makes the cell ``<scenario>@1003``.
    """
    if scenario.vary is None:
        plan = library.floorplan(required(scenario.floorplan))
        raise_all(_without_walls(plan))
        return ((scenario.name, plan),)
    robot = library.robot(required(scenario.robot))
    variants = library.variants(scenario.vary, inscribed_radius(robot.footprint))
    return tuple((f"{scenario.name}@{name.rpartition('_')[2]}", plan) for name, plan in variants)


def _without_walls(plan: FloorPlan) -> Iterator[Finding]:
    """Yield an error for each space whose walls have no thickness or height."""
    for space in plan.spaces:
        for wall in space.walls[:1]:
            size = min(wall.thickness, wall.height)
            if size <= 0.0:
                message = f"the walls of {space.name} are {size:g} m thick or high"
                hint = "write a thickness and a height above 0 m"
                yield Finding(space.where, message, hint)


def _compose_cells(draft: Draft) -> tuple[CampaignCell, ...]:
    """Return the cells of all scenarios: one each, or one for each variant of its floor plan."""
    composer = Composer(draft.library, draft.text.seed)
    return tuple(
        gather(
            partial(_compose_cell, scenario, name, plan, draft, composer)
            for scenario in draft.scenarios.values()
            for name, plan in _plans(scenario, draft.library)
        )
    )


def _compose_cell(
    scenario: ResolvedScenario, name: str, plan: FloorPlan, draft: Draft, composer: Composer
) -> CampaignCell:
    library = draft.library
    mission, document = library.mission(required(scenario.mission))
    robot, robot_file = library.robot_file(required(scenario.robot))
    loaded = tuple(map(library.loaded_sut, scenario.suts))
    suts = tuple(one.reference for one in loaded)
    settings, given_map = scenario.map, None
    if scenario.map_file is not None:
        settings, given_map = library.map(scenario.map_file)
    oracles = pick_oracles(scenario, draft.oracles, draft.text)
    repeats = repeat_policy(draft.text.repeats).at_most
    if "repeats" not in draft.document.data:
        repeats = default_repeats(suts)
    references = (*scenario.objects, *scenario.behaviours)
    layers = tuple(map(library.configured_scenery, references))
    scene = composer.scene(plan, layers[: len(scenario.objects)])
    resolved = composer.behaviours(scenario, scene, layers, range(repeats))
    library.warnings.extend(resolved[0].warnings)
    waypoints = enumerate(mission.waypoints)
    whole = CampaignCell(
        name=name,
        scenario=scenario,
        plan=plan,
        layers=layers,
        scene=scene,
        mission=mission,
        mission_where=document.where(),
        places={
            **places_of(layers, plan),
            **dict(resolved[0].places),
            **{w.id: document.where(("waypoints", number)) for number, w in waypoints},
            "start": document.where(("start",)),
            **{f"sut {s.name}": r.where for s, r in zip(suts, scenario.suts, strict=True)},
        },
        robot=robot,
        robot_file=robot_file,
        suts=suts,
        oracles=oracles,
        behaviours=tuple(one.behaviours for one in resolved),
        map=settings,
        limit=scenario.limit,
        limit_where=limit_place(scenario.name, draft.text, draft.document),
        given_map=given_map,
        sut_values={one.reference.name: one.settings for one in loaded},
    )
    cell = leave_out(whole)
    raise_all(
        problem
        for oracle in oracles
        for problem in check_references(oracle, cell.scene, cell.mission)
    )
    return cell


def _announce_repeats(suts: Iterable[SutReference], document: YamlDocument) -> Iterator[Finding]:
    """Yield the default number of runs of systems that are not repeatable, if it applies."""
    names = dict.fromkeys(sut.name for sut in suts if not sut.repeatable)
    if names and "repeats" not in document.data:
        message = (
            f"{', '.join(names)}: not repeatable, so every scenario is run {EXTERNAL_REPEATS} "
            "times with it; the campaign gives no number"
        )
        where = document.where(("matrix", "sut"))
        hint = f'write "repeats: {EXTERNAL_REPEATS}" for all systems, or another number'
        yield Finding(where, message, hint, Severity.WARNING)
