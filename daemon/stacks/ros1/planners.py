"""Which planners a configuration has, by the names pluginlib knows them by, and their parameters.

move_base loads a planner by its full name (``navfn/NavfnROS``) and calls its namespace by the last
part of it. Only the namespaces of the planners that are chosen are read.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final, Generic, TypeAlias, TypeVar

from daemon.stacks.findings import FindingCollector, ParameterFinding, ParameterLocation
from daemon.stacks.ros1 import dwa, global_planner, navfn, trajectory_planner
from daemon.stacks.ros1.base_local_planner.controller import Objection
from daemon.stacks.ros1.dwa import DwaParameters
from daemon.stacks.ros1.global_planner import GlobalPlannerParameters
from daemon.stacks.ros1.navfn import NavfnParameters
from daemon.stacks.ros1.parameters import ParameterTree, read_section
from daemon.stacks.ros1.trajectory_planner import TrajectoryPlannerParameters

GlobalPlannerChoice: TypeAlias = NavfnParameters | GlobalPlannerParameters
LocalPlannerChoice: TypeAlias = DwaParameters | TrajectoryPlannerParameters
P = TypeVar("P")

NAVFN: Final = "navfn/NavfnROS"
GLOBAL_PLANNER: Final = "global_planner/GlobalPlanner"
DWA: Final = "dwa_local_planner/DWAPlannerROS"
TRAJECTORY: Final = "base_local_planner/TrajectoryPlannerROS"
_ELSEWHERE: Final = (
    "to test a stack that uses it, bring that stack itself as the system under test "
    '(README, "Bring your own stack")'
)


def _nothing(parameters: Any) -> tuple[Objection, ...]:
    return ()


@dataclass(frozen=True, slots=True)
class _Planner(Generic[P]):
    """A planner that is built in: what its parameters are, and what to say about them."""

    model: type[P]
    without_effect: Mapping[str, str]
    renamed: Mapping[str, str] = field(default_factory=dict)
    contradictions: Callable[[P], tuple[Objection, ...]] = _nothing
    """Limits no robot can drive with: errors."""
    doubts: Callable[[P], tuple[Objection, ...]] = _nothing
    """What will probably not do what its user wants: warnings."""


GLOBAL: Final[Mapping[str, _Planner[Any]]] = {
    NAVFN: _Planner(NavfnParameters, navfn.WITHOUT_EFFECT),
    GLOBAL_PLANNER: _Planner(GlobalPlannerParameters, global_planner.WITHOUT_EFFECT),
}
LOCAL: Final[Mapping[str, _Planner[Any]]] = {
    DWA: _Planner(DwaParameters, dwa.WITHOUT_EFFECT, dwa.RENAMED, dwa.contradictions, dwa.doubts),
    TRAJECTORY: _Planner(
        TrajectoryPlannerParameters,
        trajectory_planner.WITHOUT_EFFECT,
        contradictions=trajectory_planner.contradictions,
        doubts=trajectory_planner.doubts,
    ),
}


def namespace_of(planner: str) -> str:
    """Return the namespace of a plugin's parameters: the last part of its name."""
    return re.split(r"[/:]", planner)[-1]


NAMESPACES: Final = frozenset(namespace_of(name) for name in (*GLOBAL, *LOCAL))
"""The namespaces of the planners that are built in."""


def read_global_planner(tree: ParameterTree, chosen: str) -> GlobalPlannerChoice:
    """Return the parameters of the global planner called ``chosen``; others are refused."""
    place = ("move_base", "base_global_planner")
    name = _known(chosen, GLOBAL, place, "global", tree.report) or NAVFN
    read: GlobalPlannerChoice = _read(tree, name, GLOBAL[name], {})
    return read


def read_local_planner(
    tree: ParameterTree, chosen: str, controller_frequency: float
) -> LocalPlannerChoice:
    """Return the parameters of the local planner called ``chosen``; others are refused.

    It inherits ``controller_frequency`` [Hz] where it has none of its own.
    """
    place = ("move_base", "base_local_planner")
    name = _known(chosen, LOCAL, place, "local", tree.report)
    if name is None:
        return DwaParameters()
    inherited = {"controller_frequency": controller_frequency}
    read: LocalPlannerChoice = _read(tree, name, LOCAL[name], inherited)
    return read


def _known(
    name: str,
    planners: Mapping[str, _Planner[Any]],
    place: ParameterLocation,
    kind: str,
    report: FindingCollector,
) -> str | None:
    """Return ``name`` when pluginlib would find it and it is built in; otherwise refuse it."""
    if name in planners:
        return name
    near = [full for full in planners if namespace_of(full) == namespace_of(name.strip())]
    if near:
        message = f'pluginlib knows no {kind} planner "{name}": a name is taken to the letter'
        report.fatal.append(ParameterFinding(place, message, f"write {near[0]}"))
        return None
    message = f"the {kind} planner {name} is not built in, {_listed(planners)}"
    report.fatal.append(ParameterFinding(place, message, _ELSEWHERE))
    return None


def _listed(names: Iterable[str]) -> str:
    listed = list(names)
    return f"{', '.join(listed)} {'is' if len(listed) == 1 else 'are'}"


def _read(tree: ParameterTree, name: str, planner: _Planner[P], inherited: Mapping[str, Any]) -> P:
    """Read a planner's section; what it ``inherited`` counts where it says ``None``."""
    path = ("move_base", namespace_of(name))
    given = tree.at(*path)
    before = len(tree.report.fatal)
    read = read_section(
        planner.model,
        given,
        path,
        tree.report,
        without_effect=planner.without_effect,
        renamed=planner.renamed,
    )
    missing = {n: value for n, value in inherited.items() if getattr(read, n) is None}
    whole: Any = read
    read = replace(whole, **missing)
    if len(tree.report.fatal) == before:
        tree.report.fatal += _findings(planner.contradictions(read), path, given)
    if len(tree.report.fatal) == before:
        tree.report.problems += _findings(planner.doubts(read), path, given)
    return read


def _findings(
    found: Iterable[Objection], path: ParameterLocation, given: Mapping[str, Any]
) -> list[ParameterFinding]:
    # At the first of its parameters that somebody wrote; the others have their defaults.
    return [
        ParameterFinding((*path, *[name for name in each.names if name in given][:1]), each.text)
        for each in found
    ]


def say_unread(tree: ParameterTree, chosen: Iterable[str]) -> None:
    """Say of the namespaces of planners that are not ``chosen`` that nobody reads them.

    ``TrajectoryPlannerROS`` is left to the recovery that turns on the spot, which reads it.
    """
    names = tuple(chosen)
    read = {namespace_of(name) for name in names}
    for space in sorted(NAMESPACES - read - {"TrajectoryPlannerROS"}):
        reason = f"the planners are {' and '.join(names)}"
        for name in tree.at("move_base", space):
            place = ("move_base", space, name)
            tree.report.without_effect.append(ParameterFinding(place, reason))
