"""Parameters in which a system under test differs from the one it is like."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daemon.blame._types import Element
from daemon.campaign.layers import SUT, Library, find_layer
from daemon.campaign.load import Cell
from daemon.campaign.settings import Setting, Settings, merged, tree_of
from daemon.spec import SutReference
from daemon.suts import check_parameters
from grammars.diagnostics import InputError, Where

_DEEP: Final = 2
_LONG: Final = 60
"""Names and values of parameters are shown so far."""


@dataclass(frozen=True, slots=True)
class Differences:
    """A system under test as another one, ``base``, with differences: some settings each.

    ``like`` is the name of the other one, empty when it is the defaults of the kind.
    """

    whole: SutReference
    like: str
    base: Settings
    changes: tuple[tuple[Element, Settings], ...]

    @property
    def elements(self) -> tuple[Element, ...]:
        """One element for each line in which they differ."""
        return tuple(element for element, _ in self.changes)

    def kept(self, elements: Collection[Element]) -> Settings:
        """Return the settings of the differences among ``elements``."""
        found: Settings = {}
        for element, settings in self.changes:
            if element in elements:
                found |= settings
        return found

    def sut(self, elements: Collection[Element]) -> SutReference:
        """Return the system with only the differences among ``elements``.

        Raises ``ValueError`` when its kind does not take such parameters.
        """
        if all(element in elements for element in self.elements):
            return self.whole
        tree = tree_of(merged(self.base, self.kept(elements)))
        check_parameters(self.whole.kind, tree)
        return SutReference(self.whole.name, self.whole.kind, tree)


def differences(cell: Cell, sut: SutReference, folder: Path, library: Library) -> Differences:
    """Compare a system under test of a cell with the one its file says it is like."""
    for reference in cell.scenario.suts:
        try:
            path = find_layer(folder, reference, SUT)
        except InputError:
            continue  # a kind by its name: no file, nothing to compare
        loaded = library.sut_file(path)
        if loaded.reference == sut:
            break
    else:
        return Differences(sut, "", {}, ())
    if len(loaded.files) > 1:
        other = library.sut_file(Path(loaded.files[1]))
        like, base = other.reference.name, other.settings
    else:
        own = loaded.files[0]
        base = {p: s for p, s in loaded.settings.items() if s.where.file != own}
        like = ""
    return Differences(sut, like, base, _changes(base, loaded.settings))


def _changes(base: Settings, settings: Settings) -> tuple[tuple[Element, Settings], ...]:
    """Return what differs, one element for all that one place in a file says."""
    differing = {
        path: setting
        for path, setting in settings.items()
        if path not in base or base[path].value != setting.value
    }
    nowhere = Where("")
    differing |= {path: Setting(None, nowhere) for path in base if path not in settings}
    groups: dict[object, Settings] = {}
    for path, setting in differing.items():
        key = setting.where if setting.value is not None else path
        groups.setdefault(key, {})[path] = setting
    return tuple(
        (Element("parameter", _spelled(group), index), group)
        for index, group in enumerate(groups.values())
    )


def _spelled(group: Settings) -> str:
    """Return what a line says: the path as far as all its settings share it, and the value."""
    paths = list(group)
    shared = 1
    while shared < min(map(len, paths)) and len({path[-shared - 1 :] for path in paths}) == 1:
        shared += 1
    value = group[paths[0]].value
    shown = "removed" if value is None else str(value)
    name = "/".join(paths[0][-min(shared, _DEEP) :])
    return f"{name}: {shown if len(shown) <= _LONG else shown[: _LONG - 1] + '…'}"
