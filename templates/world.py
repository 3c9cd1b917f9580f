"""World and settings of an export of artefacts.

Named states of its objects come from their layers (:func:`named_states`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal, TypeAlias

from grammars.floorplan import FloorPlan
from grammars.model.behaviour import Behaviour
from grammars.model.grid import MapRule, OccupancyGrid
from grammars.model.mission import Mission
from grammars.model.robot import Robot
from grammars.model.scene import Scene
from grammars.scenery import SceneryLayer
from templates.naming import file_name

NamedStates: TypeAlias = tuple[tuple[str, tuple[tuple[str, float], ...]], ...]
"""Joint positions [rad or m] by scene-wide joint name, by the name of the state."""


def named_states(scene: Scene, layers: Iterable[SceneryLayer]) -> NamedStates:
    """Return, for every state name, positions [rad or m] by scene-wide joint name.

    Mirrored objects turn in the opposite direction, as in the scene.
    """
    models = {model.name: model for layer in layers for model in layer.models}
    states: dict[str, dict[str, float]] = {}
    for thing in scene.objects:
        model = models.get(thing.model)
        if model is None:
            continue
        turning = {joint.name for joint in thing.joints if joint.kind == "revolute"}
        for state in model.states:
            for joint, position in state.positions:
                sign = -1.0 if thing.mirrored and joint in turning else 1.0
                states.setdefault(state.name, {})[f"{thing.name}.{joint}"] = sign * position + 0.0
    return tuple((name, tuple(positions.items())) for name, positions in states.items())


DEFAULT_LASER_HEIGHT: Final = 0.3
DEFAULT_RESOLUTION: Final = 0.05
DEFAULT_RULE: Final = "outline"


@dataclass(frozen=True, slots=True)
class BehaviourDraw:
    """Behaviours of some repeats; ``name`` is empty if all repeats have the same ones."""

    name: str
    behaviours: tuple[Behaviour, ...]


@dataclass(frozen=True, slots=True)
class ArtefactWorld:
    """Scene and, if it comes from a campaign, mission, robot and behaviours.

    ``states`` are named states of the objects: joint positions [rad or m] by scene-wide joint
    name. ``layers`` are the scenery layers of the scene, in order, ``sources`` all source files.
    ``resolution`` [m], ``rule`` and ``doors`` are those of the campaign's maps. Doors ``none``
    omits objects from the map of a run, ``initial`` draws them at their start. ``given_map`` is the
    campaign's own map instead of a drawn one.
    """

    name: str
    scene: Scene
    plan: FloorPlan | None = None
    mission: Mission | None = None
    robot: Robot | None = None
    draws: tuple[BehaviourDraw, ...] = (BehaviourDraw("", ()),)
    states: NamedStates = ()
    sources: tuple[Path, ...] = ()
    resolution: float = DEFAULT_RESOLUTION
    rule: MapRule = DEFAULT_RULE
    doors: Literal["none", "initial"] = "none"
    given_map: OccupancyGrid | None = None
    layers: tuple[SceneryLayer, ...] = ()


@dataclass(frozen=True, slots=True)
class ExportSettings:
    """Settings of an export.

    ``laser_height`` [m] defaults to the robot's first laser, ``resolution`` [m] to the campaign's.
    Waypoints keep ``distance`` [m] from the walls and begin with number ``first``. They run
    ``forward`` or backward through the corners of a space, and return to the first if ``closed``.
    Their ``yaw`` is along the path or ``zero``. A ``timestamp`` (ISO 8601), if any, goes into the
    provenance.
    """

    laser_height: float | None = None
    resolution: float | None = None
    distance: float = 0.7
    first: int = 0
    forward: bool = True
    closed: bool = False
    yaw: Literal["zero", "path"] = "zero"
    timestamp: str = ""


@dataclass(slots=True)
class ExportJob:
    """Export of one world into ``folder``, the argument of all makers of artefacts.

    ``files`` collects the files by kind, ``notes`` the losses in their formats.
    """

    world: ArtefactWorld
    folder: Path
    settings: ExportSettings = field(default_factory=ExportSettings)
    files: dict[str, tuple[Path, ...]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    @property
    def name(self) -> str:
        """The world's name as a file name."""
        return file_name(self.world.name)

    @property
    def building(self) -> str:
        """The floor plan's name as a file name."""
        return file_name(self.world.scene.name)

    @property
    def laser_height(self) -> float:
        """Height of the laser plane [m]."""
        if self.settings.laser_height is not None:
            return self.settings.laser_height
        robot = self.world.robot
        return robot.laser.z if robot else DEFAULT_LASER_HEIGHT

    @property
    def resolution(self) -> float:
        """Size of a cell of the maps [m]."""
        return self.settings.resolution or self.world.resolution

    def path(self, *parts: str) -> Path:
        """Return the path of a file in the folder; create its parent folders."""
        path = self.folder.joinpath(*parts)
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def write(self, path: Path, text: str) -> Path:
        """Write ``text`` with the same line ends on every machine."""
        path.write_text(text, encoding="utf-8", newline="\n")
        return path
