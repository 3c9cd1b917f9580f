"""The feature model of scenarios (Ortega et al. 2024, figure 1 and sections 2.2, 3.1), and counts.

Four mandatory features as in the paper: testing objective, system under test, mission, scenery.
The figure is not exhaustive by its own account; what stands below its second level is taken from
the prose of sections 2.2, 3.1, 3.3 and table 1, and kept to what a run can be asked about. Where
the paper gives no number (how many waypoints are many) the rule does, in its ``about``. Counted
are the features that a set of runs exercises.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from daemon.analysis.coverage import _rules as rules
from daemon.analysis.coverage._results import FeatureCount
from daemon.analysis.coverage._rules import RunFacts
from grammars.model.behaviour import Hold, JointEvent, KeyFrames, Reaction, Trigger, Walk
from grammars.model.movers import is_mover

FeatureRule: TypeAlias = Callable[[RunFacts], bool]
FeatureNamer: TypeAlias = Callable[[RunFacts], str]
ChildGroup: TypeAlias = Literal["all", "or", "alternative"]


@dataclass(frozen=True, slots=True)
class ScenarioFeature:
    """A node of the model: ``path`` is its place in the tree, names joined by ``/``.

    A node with children says by ``group`` how many of them a scenario has: ``all`` of the
    mandatory ones, at least one (``or``), exactly one (``alternative``). A leaf has the rule
    that recognises it in a run as planned and, where planned and done may differ, the rule
    ``done`` that finds it in the trace. A node with ``named`` has one alternative for each name
    the campaign brings.
    """

    path: str
    about: str
    planned: FeatureRule | None = None
    done: FeatureRule | None = None
    named: FeatureNamer | None = None
    group: ChildGroup = "all"
    optional: bool = False

    @property
    def parent(self) -> str:
        """Path of the node above, empty for the four main features."""
        return self.path.rpartition("/")[0]


@dataclass(frozen=True, slots=True)
class FeatureModel:
    """Features, parents before children."""

    features: tuple[ScenarioFeature, ...]


_OBJECTIVE: Final = (
    ScenarioFeature("objective", "what the test is for; told by what its oracles read", group="or"),
    ScenarioFeature(
        "objective/functional",
        "an oracle judges whether the mission is done, or the localisation",
        lambda run: run.judges(rules.MISSION, "mission", "loc"),
    ),
    ScenarioFeature(
        "objective/robustness",
        "something judges a run whose scenery changes of itself: by the clock, on an occasion, "
        "walking about",
        rules.robustness,
    ),
    ScenarioFeature(
        "objective/safety",
        "an oracle judges clearance or contact",
        lambda run: run.judges("clearance", "contact"),
    ),
    ScenarioFeature(
        "objective/performance",
        "an oracle judges or measures time, way or speed",
        lambda run: run.measures("elapsed", "mission.leg.elapsed", "path.length", "speed"),
    ),
)
_SUT: Final = (
    ScenarioFeature("sut", "what is tested, on which robot"),
    ScenarioFeature(
        "sut/configuration",
        "the systems under test",
        named=lambda run: run.spec.sut.name,
        group="alternative",
    ),
    ScenarioFeature("sut/base", "how the robot can move", group="alternative"),
    ScenarioFeature(
        "sut/base/differential",
        "forwards and turning",
        lambda run: run.spec.robot.drive.kind == "differential",
    ),
    ScenarioFeature(
        "sut/base/omnidirectional",
        "sideways as well",
        lambda run: run.spec.robot.drive.kind == "omnidirectional",
    ),
    ScenarioFeature("sut/odometry", "what the wheels tell", group="alternative"),
    ScenarioFeature("sut/odometry/perfect", "equals the true motion", rules.perfect_odometry),
    ScenarioFeature(
        "sut/odometry/erring", "grows wrong on the way", lambda run: not rules.perfect_odometry(run)
    ),
    ScenarioFeature("sut/map", "whether the map shows the objects", group="alternative"),
    ScenarioFeature(
        "sut/map/bare",
        "walls only: the world differs from it by its objects",
        lambda run: run.spec.map.doors == "none" and not run.spec.map.file,
    ),
    ScenarioFeature(
        "sut/map/furnished",
        "with objects as they stand at the start",
        lambda run: run.spec.map.doors == "initial",
    ),
    ScenarioFeature(
        "sut/map/own",
        "a map of its own: the world differs from it by whatever does",
        lambda run: bool(run.spec.map.file),
    ),
)
_MISSION: Final = (
    ScenarioFeature("mission", "what the robot has to do"),
    ScenarioFeature("mission/waypoints", "how many places it has to reach", group="alternative"),
    ScenarioFeature(
        "mission/waypoints/one",
        "a single Go To action",
        lambda run: len(run.spec.mission.waypoints) == 1,
    ),
    ScenarioFeature(
        "mission/waypoints/few",
        "two to five in a sequence",
        lambda run: 2 <= len(run.spec.mission.waypoints) <= rules.FEW,
    ),
    ScenarioFeature(
        "mission/waypoints/many",
        "more than five in a sequence",
        lambda run: len(run.spec.mission.waypoints) > rules.FEW,
    ),
    ScenarioFeature(
        "mission/distance", "longest straight line between two of them", group="alternative"
    ),
    ScenarioFeature(
        "mission/distance/near", "less than 15 m", lambda run: run.longest_leg < rules.FAR
    ),
    ScenarioFeature(
        "mission/distance/far", "15 m or more", lambda run: run.longest_leg >= rules.FAR
    ),
    ScenarioFeature("mission/reach", "whether a doorway lies between them", group="alternative"),
    ScenarioFeature(
        "mission/reach/one-room",
        "start and waypoints in one space",
        lambda run: len(set(run.rooms)) == 1,
    ),
    ScenarioFeature(
        "mission/reach/across-rooms",
        "in several spaces",
        lambda run: len(set(run.rooms)) > 1,
        rules.crossed_rooms,
    ),
    ScenarioFeature(
        "mission/circuit", "comes back to where it has been", rules.circuit, optional=True
    ),
    ScenarioFeature(
        "mission/heading",
        "asks for a heading somewhere",
        lambda run: any(waypoint.yaw is not None for waypoint in run.spec.mission.waypoints),
        optional=True,
    ),
)
_SCENERY: Final = (
    ScenarioFeature("scenery", "the world around the robot"),
    ScenarioFeature(
        "scenery/plan", "features of the floor plan besides walls", group="or", optional=True
    ),
    ScenarioFeature(
        "scenery/plan/doorways",
        "passages between spaces",
        lambda run: any(door.z_min <= 0.0 for door in run.scene.doorways),
    ),
    ScenarioFeature(
        "scenery/plan/narrow-doorways",
        "with less than 0.2 m on either side of the robot (safety distance of section 4.3)",
        rules.narrow_doorways,
    ),
    ScenarioFeature(
        "scenery/plan/columns",
        "columns",
        lambda run: any(solid.kind == "column" for solid in run.scene.solids),
    ),
    ScenarioFeature(
        "scenery/plan/dividers",
        "dividers",
        lambda run: any(solid.kind == "divider" for solid in run.scene.solids),
    ),
    ScenarioFeature("scenery/objects", "what is put into the building", group="or", optional=True),
    ScenarioFeature("scenery/objects/hinged", "objects with a revolute joint", rules.hinged),
    ScenarioFeature("scenery/objects/sliding", "objects with a prismatic joint", rules.sliding),
    ScenarioFeature("scenery/objects/furniture", "objects that cannot move", rules.furniture),
    ScenarioFeature(
        "scenery/objects/agents",
        "movers: people, animals, carts",
        lambda run: any(is_mover(o.joints) for o in run.scene.objects),
    ),
    ScenarioFeature("scenery/dynamics", "how it changes during a run", group="or"),
    ScenarioFeature(
        "scenery/dynamics/static",
        "nothing moves of itself",
        lambda run: not run.has_behaviour(KeyFrames, Trigger, Reaction, Walk),
    ),
    ScenarioFeature(
        "scenery/dynamics/posed",
        "joints held in a pose (initial joint pose)",
        lambda run: run.has_behaviour(Hold),
    ),
    ScenarioFeature(
        "scenery/dynamics/pushable", "joints that nothing holds or drives", rules.pushable
    ),
    ScenarioFeature(
        "scenery/dynamics/timed",
        "joints move by the clock",
        lambda run: run.has_behaviour(KeyFrames),
        lambda run: run.logged(JointEvent.KEY_FRAME),
    ),
    ScenarioFeature(
        "scenery/dynamics/triggered",
        "joints move as the robot nears",
        lambda run: run.has_behaviour(Trigger),
        lambda run: run.logged(JointEvent.TRIGGERED),
    ),
    ScenarioFeature(
        "scenery/dynamics/reacting",
        "joints move on an occasion",
        lambda run: run.has_behaviour(Reaction),
        lambda run: run.logged(JointEvent.REACTS),
    ),
    ScenarioFeature(
        "scenery/dynamics/walking", "movers walk", lambda run: run.has_behaviour(Walk), rules.walked
    ),
)
MODEL: Final = FeatureModel((*_OBJECTIVE, *_SUT, *_MISSION, *_SCENERY))
"""The model campaigns are held against."""


@dataclass(frozen=True, slots=True)
class RecognisedFeatures:
    """Paths of the leaves one run plans, and of those it exercised: by its trace if it has one."""

    planned: tuple[str, ...]
    exercised: tuple[str, ...]
    recorded: bool


def recognise_features(model: FeatureModel, facts: RunFacts) -> RecognisedFeatures:
    """Return the leaves of ``model`` that a run has."""
    planned, exercised = [], []
    for feature in model.features:
        path = _present_path(feature, facts)
        if path is None:
            continue
        planned.append(path)
        if facts.trace is None or feature.done is None or feature.done(facts):
            exercised.append(path)
    return RecognisedFeatures(tuple(planned), tuple(exercised), facts.trace is not None)


def _present_path(feature: ScenarioFeature, facts: RunFacts) -> str | None:
    if feature.named is not None:
        return f"{feature.path}/{feature.named(facts)}"
    return feature.path if feature.planned is not None and feature.planned(facts) else None


def feature_leaves(model: FeatureModel, runs: Iterable[RecognisedFeatures]) -> dict[str, str]:
    """Return every leaf and what it is about, in the order of the model.

    A feature with names from the campaign has one leaf for each name that ``runs`` bring.
    """
    met = dict.fromkeys(path for run in runs for path in run.planned)
    found: dict[str, str] = {}
    for feature in model.features:
        if feature.named is not None:
            prefix = f"{feature.path}/"
            found |= {path: feature.about for path in met if path.startswith(prefix)}
        elif feature.planned is not None:
            found[feature.path] = feature.about
    return found


def feature_counts(
    model: FeatureModel, runs: Sequence[RecognisedFeatures]
) -> tuple[FeatureCount, ...]:
    """Count runs per leaf."""
    planned = Counter(path for run in runs for path in run.planned)
    done = Counter(path for run in runs if run.recorded for path in run.exercised)
    return tuple(
        FeatureCount(path, about, planned[path], done[path])
        for path, about in feature_leaves(model, runs).items()
    )
