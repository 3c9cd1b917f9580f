"""The feature model of scenarios (Ortega et al. 2024, figure 1 and sections 2.2, 3.1), and counts.

The four mandatory features of the paper head the paths: testing objective, system under test,
mission, scenery. The paper says that its figure is not exhaustive. The features below its second
level come from the prose of sections 2.2, 3.1, 3.3 and table 1, if runs show them. Numbers that the
paper does not give (how many waypoints are many) are in ``about`` of the rule.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

from daemon.analysis.coverage import _rules as rules
from daemon.analysis.coverage._results import FeatureCount
from daemon.analysis.coverage._rules import RunFacts
from grammars.model.behaviour import Behaviour, Hold, JointEvent, KeyFrames, Reaction, Trigger, Walk
from grammars.model.movers import is_mover, own_joints

FeatureRule: TypeAlias = Callable[[RunFacts], bool]


@dataclass(frozen=True, slots=True)
class ScenarioFeature:
    """A feature: ``path`` is its place in the tree, names joined by ``/``.

    ``planned`` recognises it in the specification of a run. If the trace may differ, ``done`` finds
    it there. A path that ends in ``/`` stands for one feature for each value of ``name``.
    """

    path: str
    about: str
    planned: FeatureRule = lambda _: True
    done: FeatureRule | None = None
    name: Callable[[RunFacts], str] = lambda _: ""


def _drive(kind: str) -> FeatureRule:
    return lambda run: run.spec.robot.drive.kind == kind


def _waypoints(least: int, most: float) -> FeatureRule:
    return lambda run: least <= len(run.spec.mission.waypoints) <= most


def _solid(kind: str) -> FeatureRule:
    return lambda run: any(solid.kind == kind for solid in run.scene.solids)


def _joint(kind: str) -> FeatureRule:
    return lambda run: any(joint.kind == kind for joint in run.own_joints)


def _behaviour(*kinds: type[Behaviour]) -> FeatureRule:
    return lambda run: run.has_behaviour(*kinds)


def _logged(event: JointEvent) -> FeatureRule:
    return lambda run: run.logged(event)


MODEL: Final = (
    ScenarioFeature(
        "objective/functional",
        "an oracle judges whether the mission is done, or the localisation",
        lambda run: run.judges(rules.MISSION, "mission", "loc"),
    ),
    ScenarioFeature(
        "objective/robustness",
        "an oracle judges a run whose scenery changes by itself: by the clock, on an occasion, "
        "by walking",
        lambda run: bool(run.judged) and run.has_behaviour(KeyFrames, Reaction, Walk),
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
    ScenarioFeature(
        "sut/configuration/", "the systems under test", name=lambda run: run.spec.sut.name
    ),
    ScenarioFeature("sut/base/differential", "forwards and turning", _drive("differential")),
    ScenarioFeature("sut/base/omnidirectional", "sideways as well", _drive("omnidirectional")),
    ScenarioFeature("sut/odometry/perfect", "equals the true motion", rules.perfect_odometry),
    ScenarioFeature(
        "sut/odometry/erring", "grows wrong on the way", lambda run: not rules.perfect_odometry(run)
    ),
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
        "a map file of the user, which may differ from the world",
        lambda run: bool(run.spec.map.file),
    ),
    ScenarioFeature("mission/waypoints/one", "a single Go To action", _waypoints(1, 1)),
    ScenarioFeature("mission/waypoints/few", "two to five in a sequence", _waypoints(2, rules.FEW)),
    ScenarioFeature(
        "mission/waypoints/many",
        "more than five in a sequence",
        _waypoints(rules.FEW + 1, math.inf),
    ),
    ScenarioFeature(
        "mission/distance/near", "less than 15 m", lambda run: run.longest_leg < rules.FAR
    ),
    ScenarioFeature(
        "mission/distance/far", "15 m or more", lambda run: run.longest_leg >= rules.FAR
    ),
    ScenarioFeature(
        "mission/reach/one-room",
        "start and waypoints in one space",
        lambda run: len(run.rooms) == 1,
    ),
    ScenarioFeature(
        "mission/reach/across-rooms",
        "in several spaces",
        lambda run: len(run.rooms) > 1,
        rules.crossed_rooms,
    ),
    ScenarioFeature("mission/circuit", "comes back to an earlier place", rules.circuit),
    ScenarioFeature(
        "mission/heading",
        "has a waypoint with a heading",
        lambda run: any(waypoint.yaw is not None for waypoint in run.spec.mission.waypoints),
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
    ScenarioFeature("scenery/plan/columns", "columns", _solid("column")),
    ScenarioFeature("scenery/plan/dividers", "dividers", _solid("divider")),
    ScenarioFeature("scenery/objects/hinged", "objects with a revolute joint", _joint("revolute")),
    ScenarioFeature(
        "scenery/objects/sliding", "objects with a prismatic joint", _joint("prismatic")
    ),
    ScenarioFeature(
        "scenery/objects/furniture",
        "objects that cannot move",
        lambda run: any(
            not own_joints(thing.joints) and not is_mover(thing.joints)
            for thing in run.scene.objects
        ),
    ),
    ScenarioFeature(
        "scenery/objects/agents",
        "movers: people, animals, carts",
        lambda run: any(is_mover(o.joints) for o in run.scene.objects),
    ),
    ScenarioFeature(
        "scenery/dynamics/static",
        "no joint moves by itself",
        lambda run: not run.has_behaviour(KeyFrames, Trigger, Reaction, Walk),
    ),
    ScenarioFeature(
        "scenery/dynamics/posed", "joints held in a pose (initial joint pose)", _behaviour(Hold)
    ),
    ScenarioFeature(
        "scenery/dynamics/pushable", "joints that nothing holds or drives", rules.pushable
    ),
    ScenarioFeature(
        "scenery/dynamics/timed",
        "joints move by the clock",
        _behaviour(KeyFrames),
        _logged(JointEvent.KEY_FRAME),
    ),
    ScenarioFeature(
        "scenery/dynamics/triggered",
        "joints move as the robot nears",
        _behaviour(Trigger),
        _logged(JointEvent.TRIGGERED),
    ),
    ScenarioFeature(
        "scenery/dynamics/reacting",
        "joints move on an occasion",
        _behaviour(Reaction),
        _logged(JointEvent.REACTS),
    ),
    ScenarioFeature("scenery/dynamics/walking", "movers walk", _behaviour(Walk), rules.walked),
)
"""The feature model of campaigns."""


def recognise_features(facts: RunFacts) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return paths of :data:`MODEL`: those that a run plans, and those that its trace shows."""
    planned = {one.path + one.name(facts): one for one in MODEL if one.planned(facts)}
    done = (path for path, one in planned.items() if one.done is None or one.done(facts))
    return tuple(planned), () if facts.trace is None else tuple(done)


def feature_counts(runs: Sequence[tuple[Sequence[str], Sequence[str]]]) -> tuple[FeatureCount, ...]:
    """Count the runs that plan and that show each feature, in the order of the model."""
    planned, done = (Counter(path for run in runs for path in run[i]) for i in (0, 1))
    return tuple(
        FeatureCount(path, feature.about, planned[path], done[path])
        for feature in MODEL
        # A path with a name stands for all names of the runs, in order of appearance.
        for path in (
            [path for path in planned if path.startswith(feature.path)]
            if feature.path.endswith("/")
            else [feature.path]
        )
    )
