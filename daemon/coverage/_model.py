"""The feature model of scenarios (Ortega et al. 2024, figure 1 and sections 2.2, 3.1), declared.

Four mandatory features as in the paper: testing objective, system under test, mission, scenery.
The figure is not exhaustive by its own account; what stands below its second level is taken from
the prose of sections 2.2, 3.1, 3.3 and table 1, and kept to what a run can be asked about. Where
the paper gives no number (how many waypoints are many) the rule does, in its ``about``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from daemon.coverage import _rules as rules
from daemon.coverage._facts import Facts

Rule: TypeAlias = Callable[[Facts], bool]
Namer: TypeAlias = Callable[[Facts], str]
Group: TypeAlias = Literal["all", "or", "alternative"]


@dataclass(frozen=True, slots=True)
class Feature:
    """A node of the model: ``path`` is its place in the tree, names joined by ``/``.

    A node with children says by ``group`` how many of them a scenario has: ``all`` of the
    mandatory ones, at least one (``or``), exactly one (``alternative``). A leaf has the rule
    that recognises it in a run as planned and, where planned and done may differ, the rule
    ``done`` that finds it in the trace. A node with ``named`` has one alternative for each name
    the campaign brings.
    """

    path: str
    about: str
    planned: Rule | None = None
    done: Rule | None = None
    named: Namer | None = None
    group: Group = "all"
    optional: bool = False

    @property
    def parent(self) -> str:
        """Path of the node above, empty for the four main features."""
        return self.path.rpartition("/")[0]


@dataclass(frozen=True, slots=True)
class Exclusion:
    """Two features that no scenario can have both, and why."""

    first: str
    second: str
    why: str


@dataclass(frozen=True, slots=True)
class FeatureModel:
    """Features, parents before children, and what excludes what beyond alternatives."""

    features: tuple[Feature, ...]
    exclusions: tuple[Exclusion, ...] = ()


_OBJECTIVE: Final = (
    Feature("objective", "what the test is for; told by what its oracles read", group="or"),
    Feature(
        "objective/functional",
        "an oracle judges whether the mission is done, or the localisation",
        rules.functional,
    ),
    Feature(
        "objective/robustness",
        "something judges a run whose scenery changes of itself: by the clock, on an occasion, "
        "walking about",
        rules.robustness,
    ),
    Feature("objective/safety", "an oracle judges clearance or contact", rules.safety),
    Feature(
        "objective/performance",
        "an oracle judges or measures time, way or speed",
        rules.performance,
    ),
)
_SUT: Final = (
    Feature("sut", "what is tested, on which robot"),
    Feature("sut/configuration", "the systems under test", named=rules.sut, group="alternative"),
    Feature("sut/base", "how the robot can move", group="alternative"),
    Feature("sut/base/differential", "forwards and turning", rules.differential),
    Feature("sut/base/omnidirectional", "sideways as well", rules.omnidirectional),
    Feature("sut/odometry", "what the wheels tell", group="alternative"),
    Feature("sut/odometry/perfect", "equals the true motion", rules.perfect_odometry),
    Feature("sut/odometry/erring", "grows wrong on the way", rules.erring_odometry),
    Feature("sut/map", "whether the map shows the objects", group="alternative"),
    Feature("sut/map/bare", "walls only: the world differs from it by its objects", rules.bare_map),
    Feature("sut/map/furnished", "with objects as they stand at the start", rules.furnished_map),
)
_MISSION: Final = (
    Feature("mission", "what the robot has to do"),
    Feature("mission/waypoints", "how many places it has to reach", group="alternative"),
    Feature("mission/waypoints/one", "a single Go To action", rules.one_waypoint),
    Feature("mission/waypoints/few", "two to five in a sequence", rules.few_waypoints),
    Feature("mission/waypoints/many", "more than five in a sequence", rules.many_waypoints),
    Feature("mission/distance", "longest straight line between two of them", group="alternative"),
    Feature("mission/distance/near", "less than 15 m", rules.near),
    Feature("mission/distance/far", "15 m or more", rules.far),
    Feature("mission/reach", "whether a doorway lies between them", group="alternative"),
    Feature("mission/reach/one-room", "start and waypoints in one space", rules.one_room),
    Feature(
        "mission/reach/across-rooms", "in several spaces", rules.across_rooms, rules.crossed_rooms
    ),
    Feature("mission/circuit", "comes back to where it has been", rules.circuit, optional=True),
    Feature("mission/heading", "asks for a heading somewhere", rules.heading, optional=True),
)
_SCENERY: Final = (
    Feature("scenery", "the world around the robot"),
    Feature("scenery/plan", "features of the floor plan besides walls", group="or", optional=True),
    Feature("scenery/plan/doorways", "passages between spaces", rules.doorways),
    Feature(
        "scenery/plan/narrow-doorways",
        "with less than 0.2 m on either side of the robot (safety distance of section 4.3)",
        rules.narrow_doorways,
    ),
    Feature("scenery/plan/columns", "columns", rules.columns),
    Feature("scenery/plan/dividers", "dividers", rules.dividers),
    Feature("scenery/objects", "what is put into the building", group="or", optional=True),
    Feature("scenery/objects/hinged", "objects with a revolute joint", rules.hinged),
    Feature("scenery/objects/sliding", "objects with a prismatic joint", rules.sliding),
    Feature("scenery/objects/furniture", "objects that cannot move", rules.furniture),
    Feature("scenery/objects/agents", "movers: people, animals, carts", rules.agents),
    Feature("scenery/dynamics", "how it changes during a run", group="or"),
    Feature("scenery/dynamics/static", "nothing moves of itself", rules.static),
    Feature("scenery/dynamics/posed", "joints held in a pose (initial joint pose)", rules.posed),
    Feature("scenery/dynamics/pushable", "joints that nothing holds or drives", rules.pushable),
    Feature("scenery/dynamics/timed", "joints move by the clock", rules.timed, rules.keyed),
    Feature(
        "scenery/dynamics/triggered", "joints move as the robot nears", rules.triggers, rules.fired
    ),
    Feature(
        "scenery/dynamics/reacting", "joints move on an occasion", rules.reacting, rules.reacted
    ),
    Feature("scenery/dynamics/walking", "movers walk", rules.walking, rules.walked),
)
_STILL: Final = "where something moves, the scenery is not static"
MODEL: Final = FeatureModel(
    (*_OBJECTIVE, *_SUT, *_MISSION, *_SCENERY),
    (
        *(
            Exclusion("scenery/dynamics/static", f"scenery/dynamics/{kind}", _STILL)
            for kind in ("timed", "triggered", "reacting", "walking")
        ),
        Exclusion("scenery/dynamics/static", "objective/robustness", "robustness needs change"),
        Exclusion("mission/waypoints/one", "mission/circuit", "one waypoint makes no circuit"),
    ),
)
"""The model campaigns are held against."""
