"""From names in a campaign file to loaded layers: where they are looked for, read once each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeVar

from daemon.campaign._file import LayerReference, Overrides, PlanVariation
from daemon.campaign._sut_files import LoadedSut, load_sut
from daemon.model.attachments import store_data
from daemon.model.spec import MapSettings, SutReference
from daemon.stacks.registry import check_parameters, sut_kinds
from grammars.floorplan import FloorPlan, load_floorplan
from grammars.jsonld import load_floorplan_jsonld, load_scenery_jsonld
from grammars.maps import WALLS_ENDING, load_walls
from grammars.model.files import load_mission, load_robot
from grammars.model.grid import OccupancyGrid
from grammars.model.map_files import pack_map, read_map
from grammars.model.mission import Mission
from grammars.model.robot import Robot
from grammars.oracle import Oracle, load_oracles
from grammars.scenery import SceneryLayer, load_scenery
from grammars.text.diagnostics import Diagnostic, InputError, Severity, Where, did_you_mean
from grammars.text.documents import YamlDocument
from grammars.variation import floorplan_variants

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class LayerKind:
    """A kind of layer: what people call it, its file endings, the folder it may share."""

    title: str
    endings: tuple[str, ...]
    folder: str


FLOORPLAN: Final = LayerKind("floor plan", (".fpm", WALLS_ENDING, ".jsonld"), "floorplans")
VARIATION: Final = LayerKind("variation", (".variation",), "floorplans")
SCENERY: Final = LayerKind("scenery", (".scenery", ".jsonld"), "scenery")
MISSION: Final = LayerKind("mission", (".mission.yaml", ".yaml"), "missions")
ROBOT: Final = LayerKind("robot", (".yaml",), "robots")
SUT: Final = LayerKind("system under test", (".yaml",), "suts")
ORACLES: Final = LayerKind("oracles", (".oracles.yaml", ".yaml"), "oracles")


_WITHOUT_VARIABLES: Final[Mapping[str, Callable[[Path], FloorPlan]]] = {
    ".jsonld": load_floorplan_jsonld,
    ".yaml": load_walls,
}
"""How floor plans that have no variables are read, by the ending of their file."""


def find_layer(folder: Path, reference: LayerReference, kind: LayerKind) -> Path:
    """Return the file a reference names.

    A name is looked for beside the campaign file, then in the kind's folder there
    (``robots/robile.yaml``), then in that folder one level up; a path is taken from the campaign
    file's folder. Raises :class:`InputError` with the names that exist.
    """
    name = reference.name
    if "/" in name or name.endswith(kind.endings):
        path = folder / name
        if path.is_file():
            return path
        raise InputError(Diagnostic(reference.where, f'no file "{name}" for the {kind.title}'))
    # Beside the campaign first, so that one may have its own robot of a name that others share.
    places = (folder, folder / kind.folder, folder / ".." / kind.folder)
    for place in places:
        for ending in kind.endings:
            if (place / f"{name}{ending}").is_file():
                return place / f"{name}{ending}"
    known = [n for place in places for n in _names_in(place, kind)]
    raise InputError(
        Diagnostic(
            reference.where,
            f'no {kind.title} "{name}": there is no {name}{kind.endings[0]} '
            f"beside the campaign nor in {kind.folder}/",
            did_you_mean(name, known),
        )
    )


def _names_in(place: Path, kind: LayerKind) -> list[str]:
    if not place.is_dir():
        return []
    # Any file may end in .yaml: where there is another ending, only that tells the kind.
    endings = [ending for ending in kind.endings if ending != ".yaml"] or kind.endings
    names = [
        p.name.removesuffix(ending)
        for p in place.iterdir()
        for ending in endings
        if p.name.endswith(ending)
    ]
    # "tiny.mission" is what another ending leaves of a name, not one that could be written.
    return [name for name in names if "." not in name]


@dataclass(frozen=True, slots=True)
class GivenMap:
    """A map of one's own: what runs say of it, and what it shows."""

    settings: MapSettings
    grid: OccupancyGrid


def _load_map(path: Path) -> GivenMap:
    grid = read_map(path)
    try:
        digest = store_data(pack_map(grid))
    except OSError as error:
        raise InputError.at(
            Where(str(path)), f"the map cannot be kept for runs: {error}"
        ) from error
    return GivenMap(MapSettings(resolution=grid.resolution, file=digest), grid)


@dataclass(slots=True)
class LayerLibrary:
    """The layers of one campaign, each file read once, findings kept."""

    folder: Path
    warnings: list[Diagnostic] = field(default_factory=list)
    _loaded: dict[tuple[str, Path], Any] = field(default_factory=dict)

    def floorplan(self, reference: LayerReference) -> FloorPlan:
        """Load a floor plan; its warnings are kept once."""
        path = find_layer(self.folder, reference, FLOORPLAN)
        values = reference.overrides
        if not values:
            return self._once("floor plan", path, self._load_floorplan)
        load = partial(self._load_floorplan, values=values, where=reference.where)
        return self._once(f"floor plan {values}", path, load)

    def variants(self, vary: PlanVariation, radius: float) -> tuple[tuple[str, FloorPlan], ...]:
        """Draw the variants of a floor plan that a robot of ``radius`` [m] can drive through."""
        path = find_layer(self.folder, vary.floorplan, VARIATION)
        draw = partial(
            floorplan_variants, n=vary.samples, seed=vary.seed, method=vary.cover, check=radius
        )
        return self._once(
            f"variants {vary.samples} {vary.cover} {vary.seed} {radius!r}", path, draw
        )

    def scenery(self, reference: LayerReference) -> SceneryLayer:
        """Load a scenery layer: objects, places or behaviours."""
        path = find_layer(self.folder, reference, SCENERY)
        return self._once("scenery", path, self._load_scenery)

    def mission(self, reference: LayerReference) -> tuple[Mission, YamlDocument]:
        """Load a mission and the document it stands in."""
        return self._once("mission", find_layer(self.folder, reference, MISSION), load_mission)

    def robot(self, reference: LayerReference) -> Robot:
        """Load a robot description."""
        return self._once("robot", find_layer(self.folder, reference, ROBOT), load_robot)

    def oracles(self, references: tuple[LayerReference, ...]) -> dict[str, Oracle]:
        """Load oracle layers; a name in two layers is taken from the later one."""
        found: dict[str, Oracle] = {}
        for reference in references:
            path = find_layer(self.folder, reference, ORACLES)
            found |= self._once("oracles", path, load_oracles)
        return found

    def map(self, reference: LayerReference) -> GivenMap:
        """Load a map of one's own and keep it where runs find it by its digest."""
        path = self.folder / reference.name
        if not path.is_file():
            hint = "name the YAML file of a map, relative to the campaign file"
            raise InputError(Diagnostic(reference.where, f'no file "{reference.name}"', hint))
        return self._once("map", path, _load_map)

    def sut(self, reference: LayerReference) -> SutReference:
        """Load a SUT file, or take a kind by its name with default parameters."""
        try:
            path = find_layer(self.folder, reference, SUT)
        except InputError:
            # A file of that name comes first: so a kind can be given parameters without renaming.
            if reference.name not in sut_kinds():
                raise
            return self._once("sut", Path(reference.name), partial(self._default_sut, reference))
        return self.sut_file(path).reference

    def sut_file(self, path: Path) -> LoadedSut:
        """Load a SUT file and all it stands on; its warnings are kept once."""
        return self._once("sut file", path, self._load_sut)

    def _load_floorplan(
        self, path: Path, values: Overrides | None = None, where: Where | None = None
    ) -> FloorPlan:
        load = _WITHOUT_VARIABLES.get(path.suffix)
        if load is None:
            plan = load_floorplan(path, values, where)
        elif values:
            message = f"{path.name} has no variables, and so none to give another value"
            raise InputError(Diagnostic(where or Where(str(path)), message, "use a plan in .fpm"))
        else:
            plan = load(path)
        self.warnings.extend(plan.warnings)
        return plan

    def _load_scenery(self, path: Path) -> SceneryLayer:
        if path.suffix == ".jsonld":
            return load_scenery_jsonld(path, self.warnings)
        return load_scenery(path)

    def _default_sut(self, reference: LayerReference, _: Path) -> SutReference:
        try:
            findings = check_parameters(reference.name, {})
        except ValueError as error:
            raise InputError(Diagnostic(reference.where, str(error))) from error
        self.warnings.extend(
            Diagnostic(reference.where, found.message, found.hint, Severity.WARNING)
            for found in findings.problems
        )
        return SutReference(reference.name, reference.name, {})

    def _load_sut(self, path: Path) -> LoadedSut:
        sut = load_sut(path, self._find_sut)
        self.warnings.extend(sut.warnings)
        return sut

    def _find_sut(self, folder: Path, reference: LayerReference) -> Path:
        """Return the SUT file that one in ``folder`` is like: near it, or near the campaign."""
        try:
            return find_layer(folder, reference, SUT)
        except InputError:
            return find_layer(self.folder, reference, SUT)

    def _once(self, kind: str, path: Path, load: Callable[[Path], T]) -> T:
        """Load a file the first time it is named."""
        # With the kind: a .jsonld file may be a floor plan for one slot and scenery for another.
        key = (kind, path)
        if key not in self._loaded:
            self._loaded[key] = load(path)
        loaded: T = self._loaded[key]
        return loaded
