"""Coverage of a campaign, as values that go through :mod:`grammars.text.codec`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class FeatureCount:
    """A feature of the model: runs that plan it, and runs in whose traces it showed.

    ``done`` counts recorded runs only; a feature without a rule for traces shows where it is
    planned. ``about`` says how it is recognised.
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

    Runs in which it ``moved`` (by 0.01 rad or 1 cm, whoever moved it), was ``triggered`` (its
    trigger or reaction went off) and was ``met``: the robot's base came as near as asked to the
    hinge or, without one, to the origin of the object. ``nearest`` [m] over all runs, ``planned``
    is how many runs had a behaviour that moves it.
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
    """A room's free floor and the parts of it that were seen and driven on [m^2]."""

    room: str
    free: float
    seen: float
    driven: float


@dataclass(frozen=True, slots=True)
class FloorArea:
    """Free floor of a scene, seen by lasers and driven on by the footprint, in any run [m^2]."""

    scene: str
    resolution: float
    runs: int
    free: float
    seen: float
    driven: float
    rooms: tuple[RoomArea, ...]


@dataclass(frozen=True, slots=True)
class Unreadable:
    """A trace that could not be taken into account, and why."""

    trace: str
    problem: str


@dataclass(frozen=True, slots=True)
class Coverage:
    """Coverage of ``runs`` runs, ``recorded`` of which by their traces.

    Doors and floor are of recorded runs; ``near`` [m] is how near a door is met.
    """

    runs: int
    recorded: int
    near: float
    features: tuple[FeatureCount, ...]
    doors: tuple[DoorCount, ...] = ()
    floor: tuple[FloorArea, ...] = ()
    unreadable: tuple[Unreadable, ...] = ()

    def exercised(self, feature: FeatureCount) -> int:
        """Return the runs that exercise a feature: by their traces if they have any."""
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
