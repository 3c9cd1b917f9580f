"""Elements of a failing run, and the answer about them, as values.

Also the parameters in which a system under test differs from the one it is like.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, TypeAlias

from daemon.campaign import (
    CampaignCell,
    LayerLibrary,
    ParameterValues,
    merge_parameters,
    parameter_tree,
)
from daemon.model.spec import SutReference
from daemon.model.verdicts import Verdict
from daemon.stacks.registry import check_parameters, stack_kind
from grammars.text.diagnostics import Where
from grammars.text.ros_yaml import ParameterValue

ElementKind: TypeAlias = Literal[
    "objects", "behaviours", "override", "parameter", "object", "waypoint", "behaviour"
]
TestOutcome: TypeAlias = Literal["pass", "fail", "unresolved"]


@dataclass(frozen=True, slots=True)
class Element:
    """A part of a failing run that it could do without.

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
        """The name of an element that has been reported in full before."""
        return self.setting or self.name

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True, slots=True)
class Without:
    """End of the run without one of the elements that it needs to fail."""

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
"""Levels of a parameter's name, and characters of its value, that are shown."""


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
        if loaded.reference == sut and (loaded.layer.files or loaded.settings):
            break  # else a kind by its name: no file, nothing to compare
    else:
        return SutDifferences(sut, "", {}, ())
    if len(loaded.layer.files) > 1:
        other = library.sut_file(Path(loaded.layer.files[1]))
        like, base = other.reference.name, other.settings
    elif loaded.layer.files:
        # Like no other: what its own file says on top of the ROS files is the difference, and what
        # the campaign says on top of that.
        own = loaded.layer.files[0]
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
