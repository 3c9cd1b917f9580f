"""What a failing run has that it could do without, and what blame found, as values.

Also the parameters in which a system under test differs from the one it is like, and what becomes
of behaviours that wait for something when parts of a run are taken away.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, TypeAlias

from daemon.campaign import (
    CampaignCell,
    LayerLibrary,
    ParameterValue,
    ParameterValues,
    merge_parameters,
    parameter_tree,
)
from daemon.model.spec import SutReference
from daemon.model.verdicts import Verdict
from daemon.stacks.registry import check_parameters, stack_kind
from grammars.model.behaviour import (
    Behaviour,
    Event,
    JointActs,
    LegBegins,
    Reaction,
    Walk,
    WaypointReached,
)
from grammars.model.mission import Waypoint
from grammars.text.diagnostics import Where

ElementKind: TypeAlias = Literal[
    "objects", "behaviours", "override", "parameter", "object", "waypoint", "behaviour"
]
TestOutcome: TypeAlias = Literal["pass", "fail", "unresolved"]


@dataclass(frozen=True, slots=True)
class Element:
    """Something a failing run has that it could do without.

    ``objects`` and ``behaviours``: a scenery layer; ``override``: what the campaign says about a
    parameter of one; ``parameter``: a value in which the system under test differs from the one
    it is like. ``object``, ``waypoint`` and ``behaviour``: single ones of the composed run.
    ``index`` tells equal names apart. The name of a ``parameter`` says its value as well;
    ``setting`` is what it is called alone, empty for all others.
    """

    kind: ElementKind
    name: str
    index: int = 0
    setting: str = ""

    @property
    def short_name(self) -> str:
        """The name for what has been told in full."""
        return self.setting or self.name

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True, slots=True)
class Without:
    """How the run ends without one of the elements that it needs to fail."""

    element: Element
    word: TestOutcome
    note: str = ""


@dataclass(frozen=True, slots=True)
class Blame:
    """The story of a failure.

    ``verdict`` is the oracle's verdict on the run, ``flips`` the layer or parameter whose adding,
    in the order of the campaign, turns it to a failure; ``layers`` are those needed, with how the
    run ends without each. ``objects``, ``waypoints``, ``behaviours`` and ``parameters`` are what
    is left of the whole run, of ``before`` of each kind, and ``last`` its verdict. ``minimal``
    says whether it is proven that nothing else can be taken away; if not, ``stopped`` says why.
    ``settings`` are the names of the ``parameters`` without their values.
    """

    run: str
    verdict: Verdict
    flips: Element | None
    layers: tuple[Without, ...]
    objects: tuple[str, ...]
    behaviours: tuple[str, ...]
    waypoints: tuple[str, ...]
    parameters: tuple[str, ...]
    before: tuple[tuple[ElementKind, int], ...]
    last: Verdict
    minimal: bool
    stopped: str
    settings: tuple[str, ...] = ()


class NoFailureError(ValueError):
    """There is nothing to explain: the run passes, or does not fail again; the message says so."""


_DEEP: Final = 2
_LONG: Final = 60
"""Names and values of parameters are shown so far."""


@dataclass(frozen=True, slots=True)
class SutDifferences:
    """A system under test as another one, ``base``, with differences: some settings each.

    ``like`` is the name of the other one, empty when it is the defaults of the kind.
    """

    whole: SutReference
    like: str
    base: ParameterValues
    changes: tuple[tuple[Element, ParameterValues], ...]

    @property
    def elements(self) -> tuple[Element, ...]:
        """One element for each line in which they differ."""
        return tuple(element for element, _ in self.changes)

    def kept(self, elements: Collection[Element]) -> ParameterValues:
        """Return the settings of the differences among ``elements``."""
        found: ParameterValues = {}
        for element, settings in self.changes:
            if element in elements:
                found |= settings
        return found

    def sut(self, elements: Collection[Element]) -> SutReference:
        """Return the system with only the differences among ``elements``.

        Raises ``ValueError`` when its kind does not take such parameters.
        """
        # The very value, so that the whole run keeps its digest and is not executed twice.
        if all(element in elements for element in self.elements):
            return self.whole
        tree = parameter_tree(merge_parameters(self.base, self.kept(elements)))
        sut = dataclasses.replace(self.whole, parameters=tree)
        check_parameters(sut.kind, sut.local_parameters)
        return sut


def sut_differences(cell: CampaignCell, sut: SutReference, library: LayerLibrary) -> SutDifferences:
    """Compare a system under test of a cell with the one its file says it is like.

    How a ROS 2 stack is started is not taken apart: without a part of it, it would not start.
    """
    if stack_kind(sut.kind).keys:
        return SutDifferences(sut, "", {}, ())
    for reference in cell.scenario.suts:
        loaded = library.loaded_sut(reference)
        if loaded.reference == sut and (loaded.files or loaded.settings):
            break  # else a kind by its name: no file, nothing to compare
    else:
        return SutDifferences(sut, "", {}, ())
    if len(loaded.files) > 1:
        other = library.sut_file(Path(loaded.files[1]))
        like, base = other.reference.name, other.settings
    elif loaded.files:
        # Like no other: what its own file says on top of the ROS files is the difference, and what
        # the campaign says on top of that.
        own = loaded.files[0]
        written = library.sut_file(Path(own)).settings
        base = {p: s for p, s in written.items() if s.where.file != own}
        like = ""
    else:
        like, base = "", {}
    return SutDifferences(sut, like, base, _changed_elements(base, loaded.settings))


def _changed_elements(
    base: ParameterValues, settings: ParameterValues
) -> tuple[tuple[Element, ParameterValues], ...]:
    """Return what differs, one element for all that one place in a file says."""
    differing = {
        path: setting
        for path, setting in settings.items()
        if path not in base or base[path].value != setting.value
    }
    nowhere = Where("")
    differing |= {path: ParameterValue(None, nowhere) for path in base if path not in settings}
    groups: dict[object, ParameterValues] = {}
    for path, setting in differing.items():
        # A footprint of five corners, or what costmap_common means for two costmaps, is one line
        # of a file and one thing to blame.
        key = setting.where if setting.value is not None else path
        groups.setdefault(key, {})[path] = setting
    return tuple(
        (_parameter_element(group, index), group) for index, group in enumerate(groups.values())
    )


def _parameter_element(group: ParameterValues, index: int) -> Element:
    """Return what a line says: the path as far as all its settings share it, and the value."""
    paths = list(group)
    shared = 1
    while shared < min(map(len, paths)) and len({path[-shared - 1 :] for path in paths}) == 1:
        shared += 1
    value = group[paths[0]].value
    shown = "removed" if value is None else str(value)
    name = "/".join(paths[0][-min(shared, _DEEP) :])
    told = shown if len(shown) <= _LONG else f"{shown[: _LONG - 1]}…"
    return Element("parameter", f"{name}: {told}", index, name)


@dataclass(frozen=True, slots=True)
class RemainingParts:
    """Joints and waypoints that are left; ``indices`` are the waypoints' places in the whole."""

    joints: frozenset[str]
    indices: tuple[int, ...]
    waypoints: tuple[Waypoint, ...]


def adapt_behaviours(
    behaviours: Iterable[Behaviour], left: RemainingParts
) -> tuple[Behaviour, ...]:
    """Return behaviours of the joints that are left, legs numbered anew.

    Raises ``ValueError`` for one that waits for what is not there any more: its run would be
    another one, not a smaller one.
    """
    return tuple(_adapt_behaviour(b, left) for b in behaviours if b.joint in left.joints)


def _adapt_behaviour(behaviour: Behaviour, left: RemainingParts) -> Behaviour:
    if not isinstance(behaviour, Reaction | Walk) or behaviour.event is None:
        return behaviour
    event = _adapt_event(behaviour.event, left)
    if event is None:
        raise ValueError(f"{behaviour.joint} waits for what is not there")
    return dataclasses.replace(behaviour, event=event)


def _adapt_event(event: Event, left: RemainingParts) -> Event | None:
    match event:
        case LegBegins(leg=leg):
            return LegBegins(left.indices.index(leg - 1) + 1) if leg - 1 in left.indices else None
        case WaypointReached(waypoint=name):
            return event if any(w.id == name for w in left.waypoints) else None
        case JointActs(joints=joints, act=act):
            there = tuple(joint for joint in joints if joint in left.joints)
            return JointActs(there, act) if there else None
