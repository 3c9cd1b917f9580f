"""Layers of a campaign, found by name, each file read once; cells, which have layers loaded."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

from daemon.campaign._file import CampaignFile, Overrides
from daemon.campaign._parameter_files import ParameterValues
from daemon.campaign._scenarios import LayerReference, PlanVariation, ResolvedScenario
from daemon.campaign._suts import LoadedSut, SutLayer, complete_sut, kind_layer, read_sut
from daemon.model.attachments import store_data
from daemon.model.spec import MapSettings, SutReference
from daemon.stacks.registry import sut_kinds
from grammars.floorplan import WALLS_ENDING, FloorPlan, ParsedFloorPlan, read_floorplan
from grammars.model.behaviour import Behaviour
from grammars.model.grid import OccupancyGrid
from grammars.model.map_files import pack_map, read_map
from grammars.model.mission import Mission
from grammars.model.mission_files import read_mission
from grammars.model.robot import Robot
from grammars.model.robot_files import read_robot
from grammars.model.scene import Scene
from grammars.oracle import Oracle, load_oracles
from grammars.scenery import SceneryLayer, configure, load_scenery
from grammars.text.diagnostics import Finding, InputError, Where, did_you_mean
from grammars.text.documents import YamlDocument, load_yaml
from grammars.text.file_kinds import kind_of_file, refuse_kind
from grammars.text.overrides import Override, override_document, placed_at
from grammars.text.sources import (
    is_file,
    is_folder,
    is_jsonld,
    names_in,
    not_recording,
    read_text,
    shipped_folder,
)

if TYPE_CHECKING:
    from grammars.variation import Variation

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class LayerKind:
    """A kind of layer: its name for people, its file endings, the folder it may share.

    Files of a kind with a ``key`` contain that key, since other files have the same ending. Some
    kinds have layers that ship, which any campaign may name.
    """

    title: str
    endings: tuple[str, ...]
    folder: str
    key: str = ""
    ships: bool = False


FLOORPLAN: Final = LayerKind("floor plan", (".fpm", WALLS_ENDING, ".jsonld", ".json"), "floorplans")
VARIATION: Final = LayerKind("variation", (".variation",), "floorplans")
SCENERY: Final = LayerKind("scenery", (".scenery", ".jsonld", ".json"), "scenery")
MISSION: Final = LayerKind("mission", (".mission.yaml", ".yaml"), "missions")
ROBOT: Final = LayerKind("robot", (".yaml",), "robots", key="robot", ships=True)
SUT: Final = LayerKind("system under test", (".yaml",), "suts", key="sut", ships=True)
ORACLES: Final = LayerKind("oracles", (".oracles.yaml", ".yaml"), "oracles")

LAYER_KINDS: Final = (ROBOT, SUT, FLOORPLAN, VARIATION, SCENERY, MISSION, ORACLES)
"""Every kind, those with shipped layers first."""


def find_layer(
    folder: Path, reference: LayerReference, kind: LayerKind, *, shipped: bool = True
) -> Path:
    """Return the file of a reference, or the folder of JSON-LD files that form one layer.

    A name is searched beside the campaign file, in the kind's folder there
    (``robots/robile.yaml``), and in that folder one level up. Shipped layers come last, unless
    ``shipped`` is false. A path is relative to the campaign file's folder. Raises
    :class:`InputError` with the names that exist.
    """
    name = reference.name
    endings = (*kind.endings, ".yml") if ".yaml" in kind.endings else kind.endings
    if "/" in name or name.endswith(endings):
        path = folder / name
        if is_file(path):
            if not name.endswith(endings):
                refuse_kind(kind_of_file(path), reference.where, name)
            return _shortened(path)
        if _is_folder_of(path, kind):
            return path
        files = [
            f"{name}{ending}" for ending in kind.endings if is_file(folder / f"{name}{ending}")
        ]
        hint = f"a path has an ending: {files[0]}" if files else ""
        raise InputError.at(reference.where, f'no file "{name}" for the {kind.title}', hint)
    places = layer_places(folder, kind, shipped=shipped)
    for place in places:
        for ending in kind.endings:
            if is_file(place / f"{name}{ending}"):
                return place / f"{name}{ending}"
        if _is_folder_of(place / name, kind):
            return place / name
    refuse_kind(kind_of_file(folder / name), reference.where, name)
    names = [n for place in places for n in layer_names(place, kind)]
    ships = ", and none of that name ships" if kind.ships else ""
    raise InputError(
        Finding(
            reference.where,
            f'no {kind.title} "{name}": there is no {name}{kind.endings[0]} '
            f"beside the campaign nor in {kind.folder}/{ships}",
            did_you_mean(name, names),
        )
    )


def _is_folder_of(path: Path, kind: LayerKind) -> bool:
    """Return whether a path is a folder of JSON-LD files, like published models."""
    return ".jsonld" in kind.endings and is_folder(path) and is_jsonld(path)


def _shortened(path: Path) -> Path:
    """Return a path without ``..`` in its middle, if it leads to the same file."""
    short = Path(os.path.normpath(path))
    # After a link to a folder, ".." leads elsewhere than the text of the path suggests.
    return short if is_file(short) and short.samefile(path) else path


def layer_places(folder: Path, kind: LayerKind, *, shipped: bool = True) -> tuple[Path, ...]:
    """Return the folders in which a campaign in ``folder`` finds layers by name, first to last."""
    # Beside the campaign first, so that it may have its own robot under a shared name.
    near = (folder, folder / kind.folder, folder / ".." / kind.folder)
    return (*near, shipped_folder() / kind.folder) if kind.ships and shipped else near


def layer_names(place: Path, kind: LayerKind) -> list[str]:
    """Return the names of the layers in a folder that have the usual ending of their kind."""
    # Any .jsonld file may be something else; these two endings identify a floor plan.
    endings = (kind.endings[0], *(ending for ending in kind.endings if ending == WALLS_ENDING))
    files = names_in(place, lambda path: path.name.endswith(endings) and _may_be(path, kind))
    names = [name.removesuffix(next(filter(name.endswith, endings))) for name in files]
    # "tiny.mission" is the rest of a name with another ending, and cannot be written.
    return [name for name in names if "." not in name]


def _may_be(path: Path, kind: LayerKind) -> bool:
    """Return whether a file has the key of its kind, without parsing it as YAML."""
    if not kind.key:
        return True
    try:
        with not_recording():
            keys = {line.partition(":")[0] for line in read_text(path).split("\n")}
    except InputError:
        return False  # an unreadable file is not proposed
    return kind.key in keys and "campaign" not in keys


_MOST_OVERRIDDEN: Final = 64
"""Most layers with overrides in the cache; each is quickly made again from its file's content."""


@dataclass(slots=True)
class LayerLibrary:
    """The layers of one campaign, each file read once, findings kept."""

    folder: Path
    warnings: list[Finding] = field(default_factory=list)
    _loaded: dict[tuple[str, Path], Any] = field(default_factory=dict)
    _overridden: dict[tuple[str, Path], Any] = field(default_factory=dict)

    def floorplan(self, reference: LayerReference) -> FloorPlan:
        """Load a floor plan; its warnings are kept once."""
        path = find_layer(self.folder, reference, FLOORPLAN)
        load = partial(self._load_floorplan, reference)
        return self._once("floor plan", path, load, reference.overrides)

    def plan_text(self, path: Path) -> ParsedFloorPlan:
        """Return a parsed ``.fpm`` plan."""
        return self._once("text of a plan", path, read_floorplan)

    def variants(self, vary: PlanVariation, radius: float) -> tuple[tuple[str, FloorPlan], ...]:
        """Draw the variants of a floor plan that a robot of ``radius`` [m] can drive through."""
        from grammars.variation import sample

        named = vary.floorplan
        path = find_layer(self.folder, named, VARIATION)

        def draw(path: Path) -> tuple[tuple[str, FloorPlan], ...]:
            variation = self.fixed_variation(named, path)
            sampled = sample(
                variation,
                vary.samples,
                seed=vary.seed,
                method=vary.cover,
                check=radius,
                suffix=True,
            )
            return tuple((variant.name, variant.plan) for variant in sampled)

        kind = f"variants {vary.samples} {vary.cover} {vary.seed} {radius!r}"
        return self._once(kind, path, draw, named.overrides)

    def fixed_variation(self, reference: LayerReference, path: Path) -> Variation:
        """Load a variation with the draws that a reference fixes."""
        from grammars.variation import fix_draws, load_variation

        values = {override.key: override.value for override in reference.values}
        places = {override.key: override.where for override in reference.values}
        variation = self._once("variation", path, load_variation)
        return fix_draws(variation, values, reference.where, places)

    def scenery(self, reference: LayerReference) -> SceneryLayer:
        """Load a scenery layer: objects, places or behaviours."""
        path = find_layer(self.folder, reference, SCENERY)
        return self._once("scenery", path, self._load_scenery)

    def configured_scenery(self, reference: LayerReference) -> SceneryLayer:
        """Load a scenery layer with the campaign's parameters."""
        plain = self.scenery(reference)
        return configure(plain, reference.overrides, reference.where, reference.lines)

    def mission(self, reference: LayerReference) -> tuple[Mission, YamlDocument]:
        """Load a mission and its document."""
        path = find_layer(self.folder, reference, MISSION)
        load = partial(self._load_document, reference, read_mission)
        return self._once("mission", path, load, reference.overrides)

    def robot(self, reference: LayerReference) -> Robot:
        """Load a robot description."""
        return self.robot_file(reference)[0]

    def robot_file(self, reference: LayerReference) -> tuple[Robot, YamlDocument]:
        """Load a robot description and its document."""
        path = find_layer(self.folder, reference, ROBOT)
        load = partial(self._load_document, reference, read_robot)
        return self._once("robot", path, load, reference.overrides)

    def oracles(self, references: tuple[LayerReference, ...]) -> dict[str, Oracle]:
        """Load oracle layers; of equal names in two layers the later one counts."""
        oracles: dict[str, Oracle] = {}
        for reference in references:
            path = find_layer(self.folder, reference, ORACLES)
            oracles |= self._once("oracles", path, load_oracles)
        return oracles

    def map(self, reference: LayerReference) -> tuple[MapSettings, OccupancyGrid]:
        """Load a map file of the user: its settings for runs, and its grid.

        The file is stored where runs find it by its digest.
        """
        path = self.folder / reference.name
        if not is_file(path):
            hint = "name the YAML file of a map, relative to the campaign file"
            raise InputError(Finding(reference.where, f'no file "{reference.name}"', hint))
        return self._once("map", path, self._load_map)

    def sut(self, reference: LayerReference) -> SutReference:
        """Load a SUT file, or take a kind by its name with default parameters."""
        return self.loaded_sut(reference).reference

    def loaded_sut(self, reference: LayerReference) -> LoadedSut:
        """Load a system under test with all findings about it."""
        # Cached, because the search for installed kinds reads the metadata of every package.
        named = Path(reference.name)
        path = self._once("place of a sut", named, partial(self._sut_place, reference))
        if path is not None and not reference.overrides:
            return self.sut_file(path)

        def load(named: Path) -> LoadedSut:
            if path is None:
                layer = kind_layer(reference.name, reference.where)
            else:
                layer = self.sut_file(path).layer
            return self._complete_sut(layer, reference.values)

        return self._once("sut", named, load, reference.overrides)

    def _sut_place(self, reference: LayerReference, _: Path) -> Path | None:
        """Return the file of a system under test, ``None`` for a kind by its name."""
        # A file of that name comes first, so that a kind can get parameters without a new name.
        # Shipped files come last, so that a plug-in keeps its meaning.
        try:
            return find_layer(self.folder, reference, SUT, shipped=False)
        except InputError:
            if reference.name in sut_kinds():
                return None
            return find_layer(self.folder, reference, SUT)

    def sut_file(self, path: Path) -> LoadedSut:
        """Load a SUT file and its bases; its warnings are kept once."""

        def load(path: Path) -> LoadedSut:
            warnings: list[Finding] = []
            with InputError.keeping(warnings):
                return self._complete_sut(read_sut(path, self._find_sut, warnings))

        return self._once("sut file", path, load)

    def _load_document(
        self, reference: LayerReference, read: Callable[[YamlDocument], T], path: Path
    ) -> tuple[T, YamlDocument]:
        """Return the value of a YAML layer with the overrides of a reference."""

        def plain(path: Path) -> tuple[T, YamlDocument]:
            document = load_yaml(path)
            return read(document), document

        # Read the plain file first: any later error comes from the overrides, and is placed there.
        value, document = self._once(read.__name__, path, plain)
        if not reference.overrides:
            return value, document
        changed = override_document(document, reference.values)
        return read(placed_at(changed, reference.where)), changed

    def _load_floorplan(self, reference: LayerReference, path: Path) -> FloorPlan:
        is_walls = path.name.endswith(WALLS_ENDING)
        if not is_walls and not is_jsonld(path):
            text = self.plan_text(path)
            plan = text.compile(reference.overrides, reference.where, reference.lines)
        elif reference.overrides:
            message = f"{path.name} has no variables to set"
            raise InputError(Finding(reference.where, message, "use a plan in .fpm"))
        # Only campaigns with maps, drawings or JSON-LD load their readers.
        elif is_walls:
            from grammars.maps import load_walls

            plan = load_walls(path)
        else:
            from grammars.jsonld import load_floorplan_jsonld

            plan = load_floorplan_jsonld(path)
        self.warnings.extend(plan.warnings)
        return plan

    def _load_map(self, path: Path) -> tuple[MapSettings, OccupancyGrid]:
        saved = read_map(path)
        self.warnings.extend(saved.warnings)
        try:
            digest = store_data(pack_map(saved.grid))
        except OSError as error:
            raise InputError.at(
                Where(str(path)), f"the map cannot be kept for runs: {error}"
            ) from error
        return MapSettings(resolution=saved.grid.resolution, file=digest), saved.grid

    def _load_scenery(self, path: Path) -> SceneryLayer:
        if is_jsonld(path):
            from grammars.jsonld import load_scenery_jsonld

            return load_scenery_jsonld(path, self.warnings)
        return load_scenery(path)

    def _complete_sut(self, layer: SutLayer, overrides: Sequence[Override] = ()) -> LoadedSut:
        sut = complete_sut(layer, overrides)
        # A search changes a system thousands of times, mostly with the same warnings.
        self.warnings.extend(warning for warning in sut.warnings if warning not in self.warnings)
        return sut

    def _find_sut(self, folder: Path, reference: LayerReference) -> Path:
        """Return the base of a SUT file in ``folder``: near it, or near the campaign."""
        try:
            return find_layer(folder, reference, SUT, shipped=False)
        except InputError:
            return find_layer(self.folder, reference, SUT)

    def _once(
        self, kind: str, path: Path, load: Callable[[Path], T], overrides: Overrides | None = None
    ) -> T:
        """Load a file once for all references with equal overrides."""
        # The key has the kind: a .jsonld file may be a floor plan in one slot, scenery in another.
        key = (f"{kind} {overrides!r}" if overrides else kind, path)
        cache = self._overridden if overrides else self._loaded
        if key not in cache:
            # A search names the same layer with other values thousands of times.
            while len(self._overridden) >= _MOST_OVERRIDDEN:
                del self._overridden[next(iter(self._overridden))]
            cache[key] = load(path)
        loaded: T = cache[key]
        return loaded


@dataclass(frozen=True, slots=True)
class CampaignCell:
    """One scenario in one world, with all its layers loaded.

    ``name`` is the scenario's, with ``@<seed>`` for a variant of its plan. ``behaviours`` are those
    of each repeat, including the reserve. ``places`` are the places in files of waypoints, objects,
    systems and the sentences about joints. The scene is composed of ``plan`` and ``layers``, with
    the campaign's overrides, objects before behaviours. ``given_map`` is the map file of the
    campaign, if it has one. ``sut_values`` are the parameters of the systems with their places, by
    name.
    """

    name: str
    scenario: ResolvedScenario
    plan: FloorPlan
    layers: tuple[SceneryLayer, ...]
    scene: Scene
    mission: Mission
    mission_where: Where
    places: Mapping[str, Where]
    robot: Robot
    robot_file: YamlDocument
    suts: tuple[SutReference, ...]
    oracles: tuple[Oracle, ...]
    behaviours: tuple[tuple[Behaviour, ...], ...]
    map: MapSettings
    limit: float
    limit_where: Where
    given_map: OccupancyGrid | None = None
    sut_values: Mapping[str, ParameterValues] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Draft:
    """A campaign while it is loaded: each stage adds what the next ones need.

    ``scenarios`` are the concrete ones by name, ``oracles`` those of the campaign's files.
    """

    text: CampaignFile
    document: YamlDocument
    library: LayerLibrary
    scenarios: Mapping[str, ResolvedScenario]
    oracles: Mapping[str, Oracle] = field(default_factory=dict)
    cells: tuple[CampaignCell, ...] = ()

    def check_scenario(self, name: str, where: Where, instead: str) -> Iterator[Finding]:
        """Yield an error unless a scenario of this name is run; ``instead`` of an abstract one."""
        if name in self.scenarios:
            return
        if name in self.text.scenarios:
            yield Finding(where, f'scenario "{name}" is abstract, it is never run', instead)
        else:
            yield Finding(where, f'no scenario "{name}" here', did_you_mean(name, self.scenarios))
