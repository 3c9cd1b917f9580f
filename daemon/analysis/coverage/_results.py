"""What a campaign has covered, as values; everything goes through :mod:`grammars.text.codec`."""

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
    """Features with one parent: those that runs plan, and those that none does."""

    path: str
    planned: tuple[FeatureCount, ...]
    missing: tuple[FeatureCount, ...]


@dataclass(frozen=True, slots=True)
class PairCount:
    """Two features and the number of runs that exercised both."""

    first: str
    second: str
    runs: int


@dataclass(frozen=True, slots=True)
class Pairs:
    """Pairwise coverage: ``possible`` pairs are those the model does not exclude."""

    possible: int
    excluded: int
    exercised: tuple[PairCount, ...]
    missing: tuple[tuple[str, str], ...]

    @property
    def share(self) -> float:
        """Share of the possible pairs that was exercised; 1 where there are none."""
        return len(self.exercised) / self.possible if self.possible else 1.0


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
class MarginHistogram:
    """Margins of one oracle: ``counts[i]`` lie in [``edges[i]``, ``edges[i + 1]``), in ``unit``.

    Zero, where pass and fail part, is an edge. ``unbounded`` passes or fails have no margin in
    figures; ``undecided`` runs were inconclusive or in error.
    """

    oracle: str
    unit: str
    edges: tuple[float, ...]
    counts: tuple[int, ...]
    passed: int
    failed: int
    undecided: int
    unbounded: int
    least: float | None
    greatest: float | None


@dataclass(frozen=True, slots=True)
class Unreadable:
    """A trace that could not be taken into account, and why."""

    trace: str
    problem: str


@dataclass(frozen=True, slots=True)
class Coverage:
    """What ``runs`` runs exercise, ``recorded`` of which were told by their traces.

    Doors, floor and margins are of recorded runs; ``near`` [m] is how near a door is met.
    """

    runs: int
    recorded: int
    near: float
    features: tuple[FeatureCount, ...]
    pairs: Pairs
    doors: tuple[DoorCount, ...] = ()
    floor: tuple[FloorArea, ...] = ()
    margins: tuple[MarginHistogram, ...] = ()
    unreadable: tuple[Unreadable, ...] = ()

    def exercised(self, feature: FeatureCount) -> int:
        """Return the runs that exercise a feature: by their traces if they have any."""
        return feature.done if self.recorded else feature.planned

    @property
    def groups(self) -> tuple[FeatureGroup, ...]:
        """The features by what they are alternatives or parts of, in the order of the model."""
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

    @property
    def never_together(self) -> tuple[tuple[str, str], ...]:
        """Missing pairs of features that were both exercised, each in other runs.

        Where a feature was not, all its pairs are missing, which tells nothing new.
        """
        there = {f.feature for f in self.features if self.exercised(f)}
        return tuple(pair for pair in self.pairs.missing if there >= set(pair))
