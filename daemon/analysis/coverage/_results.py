"""Coverage of a campaign, as values for :mod:`grammars.text.codec`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class FeatureCount:
    """A feature of the model: the runs that plan it, and the runs whose traces show it.

    ``done`` counts only recorded runs; a feature without a rule for traces counts as done if
    planned. ``about`` describes its rule.
    """

    feature: str
    about: str
    planned: int
    done: int

    @property
    def name(self) -> str:
        """The last part of its path."""
        return self.feature.rpartition("/")[2]


@dataclass(frozen=True, slots=True)
class FeatureGroup:
    """Features with one parent: those that runs plan, and the others."""

    path: str
    planned: tuple[FeatureCount, ...]
    missing: tuple[FeatureCount, ...]


@dataclass(frozen=True, slots=True)
class DoorCount:
    """An articulated object over the recorded runs of a scene.

    Counts of runs: in ``moved`` runs it moved (by 0.01 rad or 1 cm, by any cause), in ``triggered``
    runs its trigger or reaction fired. In ``met`` runs the robot's base came near to its hinge or,
    without one, to its origin. In ``planned`` runs a behaviour moves it. ``nearest`` [m] is the
    least distance over all runs.
    """

    scene: str
    door: str
    runs: int
    planned: int
    moved: int
    triggered: int
    met: int
    nearest: float | None


@dataclass(frozen=True, slots=True)
class RoomArea:
    """Free floor of a room, and its seen and driven parts [m^2]."""

    room: str
    free: float
    seen: float
    driven: float


@dataclass(frozen=True, slots=True)
class FloorArea:
    """Free floor of a scene, and its parts seen by lasers and driven on, in any run [m^2]."""

    scene: str
    resolution: float
    runs: int
    free: float
    seen: float
    driven: float
    rooms: tuple[RoomArea, ...]


@dataclass(frozen=True, slots=True)
class Unreadable:
    """An unusable trace, with the reason."""

    trace: str
    problem: str


@dataclass(frozen=True, slots=True)
class Coverage:
    """Coverage of ``runs`` runs, of which ``recorded`` have traces.

    Doors and floor come from recorded runs; ``near`` [m] is the distance at which a door is met.
    """

    runs: int
    recorded: int
    near: float
    features: tuple[FeatureCount, ...]
    doors: tuple[DoorCount, ...] = ()
    floor: tuple[FloorArea, ...] = ()
    unreadable: tuple[Unreadable, ...] = ()

    def exercised(self, feature: FeatureCount) -> int:
        """Return the number of runs that exercise a feature, by their traces if they have any."""
        return feature.done if self.recorded else feature.planned

    @property
    def groups(self) -> tuple[FeatureGroup, ...]:
        """The features by their parents, in the order of the model."""
        groups: dict[str, list[FeatureCount]] = {}
        for feature in self.features:
            groups.setdefault(feature.feature.rpartition("/")[0], []).append(feature)
        return tuple(
            FeatureGroup(
                path,
                tuple(f for f in members if f.planned),
                tuple(f for f in members if not f.planned),
            )
            for path, members in groups.items()
        )
