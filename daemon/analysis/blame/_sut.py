"""Parameters in which a system under test differs from its base."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daemon.analysis.blame._elements import Element, Elements
from daemon.campaign import (
    CampaignCell,
    LayerLibrary,
    ParameterValues,
    merge_parameters,
    parameter_tree,
)
from daemon.model.spec import SutReference
from daemon.stacks.registry import check_parameters, stack_kind
from grammars.text.diagnostics import Where
from grammars.text.ros_yaml import ParameterValue

_DEEP: Final = 2
_LONG: Final = 60
"""Most levels of a parameter's name, and characters of its value, in messages."""


@dataclass(frozen=True, slots=True)
class SutDifferences:
    """A system under test as changes of a ``base``, each of some settings.

    ``like`` is the name of the base, empty for the defaults of the kind.
    """

    whole: SutReference
    like: str = ""
    base: ParameterValues = dataclasses.field(default_factory=dict)
    changes: tuple[tuple[Element, ParameterValues], ...] = ()

    @property
    def elements(self) -> tuple[Element, ...]:
        """One element for each line with a difference."""
        return tuple(element for element, _ in self.changes)

    def remaining(self, away: Elements) -> ParameterValues:
        """Return the settings of the differences, except those ``away``."""
        settings: ParameterValues = {}
        for element, change in self.changes:
            settings |= change if element not in away else {}
        return settings

    def without(self, away: Elements) -> SutReference:
        """Return the system without the differences that are ``away``.

        Raises ``ValueError`` if its kind refuses these parameters.
        """
        # The identical value keeps the digest of the whole run, which is not executed twice.
        if away.isdisjoint(self.elements):
            return self.whole
        tree = parameter_tree(merge_parameters(self.base, self.remaining(away)))
        sut = dataclasses.replace(self.whole, parameters=tree)
        check_parameters(sut.kind, sut.local_parameters)
        return sut


def sut_differences(cell: CampaignCell, sut: SutReference, library: LayerLibrary) -> SutDifferences:
    """Compare a system under test of a cell with the base that its file names.

    The keys of a ROS 2 stack are not taken apart: without one of them it would not start.
    """
    if stack_kind(sut.kind).keys:
        return SutDifferences(sut)
    for reference in cell.scenario.suts:
        loaded = library.loaded_sut(reference)
        if loaded.reference == sut and (loaded.layer.files or loaded.settings):
            break  # otherwise a kind by its name, without a file to compare
    else:
        return SutDifferences(sut)
    files, like = loaded.layer.files, ""
    base: ParameterValues = {}
    if len(files) > 1:
        other = library.sut_file(Path(files[1]))
        like, base = other.reference.name, other.settings
    elif files:
        # Without a base the differences are the values of its own file and of the campaign, on top
        # of the ROS files.
        settings = library.sut_file(Path(files[0])).settings
        base = {path: one for path, one in settings.items() if one.where.file != files[0]}
    return SutDifferences(sut, like, base, _changed_elements(base, loaded.settings))


def _changed_elements(
    base: ParameterValues, settings: ParameterValues
) -> tuple[tuple[Element, ParameterValues], ...]:
    """Return the differences, one element for all values from one place in a file."""
    differing = {
        path: setting
        for path, setting in settings.items()
        if path not in base or base[path].value != setting.value
    }
    nowhere = Where("")
    differing |= {path: ParameterValue(None, nowhere) for path in base if path not in settings}
    groups: dict[object, ParameterValues] = {}
    for path, setting in differing.items():
        # A footprint of five corners, or a common value of two costmaps, is one line of a file and
        # one thing to blame.
        key = setting.where if setting.value is not None else path
        groups.setdefault(key, {})[path] = setting
    return tuple(
        (_parameter_element(group, index), group) for index, group in enumerate(groups.values())
    )


def _parameter_element(group: ParameterValues, index: int) -> Element:
    """Return the element of a line: the shared end of its settings' paths, and the value."""
    paths = list(group)
    shared = 1
    while shared < min(map(len, paths)) and len({path[-shared - 1 :] for path in paths}) == 1:
        shared += 1
    value = group[paths[0]].value
    text = "removed" if value is None else str(value)
    name = "/".join(paths[0][-min(shared, _DEEP) :])
    text = text if len(text) <= _LONG else f"{text[: _LONG - 1]}…"
    return Element("parameter", f"{name}: {text}", index, name)
