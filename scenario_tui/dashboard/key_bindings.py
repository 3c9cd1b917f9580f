"""Every key of the dashboard by its id: what ``config.toml`` may map, and what help lists."""

from __future__ import annotations

import pkgutil
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Final

from textual.app import App
from textual.binding import Binding
from textual.dom import DOMNode
from textual.keys import Keys, _character_to_key
from textual.screen import ModalScreen, Screen

import scenario_tui.dashboard
from grammars.text.diagnostics import Diagnostic, InputError
from scenario_tui.dashboard.app import Dashboard
from scenario_tui.dashboard.config import Config
from scenario_tui.dashboard.screens.help import (
    all_bindings,
    binding_meaning,
    our_classes,
    own_bindings,
)
from scenario_tui.dashboard.themes import DARK, LIGHT
from scenario_tui.dashboard.widgets.cell_table import CellTable
from scenario_tui.dashboard.widgets.tables import KeyedTable

_ROOMS: Final = ("screens", "widgets")
_MODIFIERS: Final = frozenset({"ctrl", "shift", "alt", "meta", "super", "hyper"})


@dataclass(frozen=True, slots=True)
class KeyBinding:
    """A key binding: ``place`` is the screen or widget it belongs to."""

    id: str
    keys: str
    place: str
    meaning: str


def list_key_bindings() -> tuple[KeyBinding, ...]:
    """Return all bindings that have an id, place by place."""
    found = [
        KeyBinding(binding.id, binding.key, _place(kind), binding_meaning(binding))
        for kind in classes_with_bindings()
        for binding in own_bindings(kind)
        if binding.id
    ]
    return tuple(dict.fromkeys(found))


def classes_with_bindings() -> tuple[type[DOMNode], ...]:
    """Return all screens and widgets of ours that bind keys, the dashboard first."""
    found: dict[type[DOMNode], None] = dict.fromkeys(our_classes(Dashboard))
    for room in _ROOMS:
        package = import_module(f"{scenario_tui.dashboard.__name__}.{room}")
        for module in pkgutil.iter_modules(package.__path__):
            found |= dict.fromkeys(_bound(import_module(f"{package.__name__}.{module.name}")))
    return tuple(found)


def _bound(module: Any) -> Iterator[type[DOMNode]]:
    # Found, not listed: a screen with keys that nobody listed could not be configured.
    for kind in vars(module).values():
        ours = isinstance(kind, type) and kind.__module__ == module.__name__
        if ours and issubclass(kind, DOMNode) and "BINDINGS" in vars(kind):
            yield kind


def _place(kind: type[DOMNode]) -> str:
    name = kind.__module__.rpartition(".")[2]
    if issubclass(kind, App) and name != "replay":
        return "everywhere"
    if not issubclass(kind, App | Screen):
        return "tables"
    return {"base": "every screen", "steering": "every campaign"}.get(name, name)


def check_config(config: Config) -> None:
    """Check what a configuration says about keys and themes.

    Raises :class:`InputError` for unknown ids, keys and themes, and for one key with two meanings
    on one screen.
    """
    from textual.theme import BUILTIN_THEMES

    themes = sorted((*BUILTIN_THEMES, DARK, LIGHT, *config.themes))
    if config.theme and config.theme not in themes:
        message = f'unknown theme "{config.theme}"; themes are {", ".join(themes)}'
        raise InputError(Diagnostic(config.where("dashboard", "theme"), message))
    # Finding all keys loads every screen.
    if config.keys:
        found = [*_unknown_ids(config)] or [*_unknown_keys(config), *_clashes(config)]
        if found:
            raise InputError(found)


def _unknown_ids(config: Config) -> Iterator[Diagnostic]:
    ids = sorted({bound.id for bound in list_key_bindings()})
    for name in config.keys:
        if name not in ids:
            message = f'unknown key id "{name}"; ids are {", ".join(ids)}'
            hint = "`scenario tui --bindings` says what they do"
            yield Diagnostic(config.where("keys", name), message, hint)


def _unknown_keys(config: Config) -> Iterator[Diagnostic]:
    # Textual takes any name and then waits for a key that never comes.
    known = {key.value.rpartition("+")[2] for key in Keys}
    known |= {_character_to_key(chr(code)) for code in range(33, 127)}
    for name, keys in config.keys.items():
        for key in keys.split(","):
            *modifiers, last = key.split("+")
            if not (set(modifiers) <= _MODIFIERS and (len(last) == 1 or last in known)):
                message = f'"{key}" is no key; keys are like "x", "X", "f5", "ctrl+d" or "slash"'
                yield Diagnostic(config.where("keys", name), message)


def _clashes(config: Config) -> Iterator[Diagnostic]:
    """Report keys that would mean two things on one screen, and do not without the file."""
    reported: set[tuple[str, ...]] = set()
    for kind in classes_with_bindings():
        if not issubclass(kind, Screen):
            continue
        bindings = all_bindings(kind) + _around(kind)
        # Some keys have two meanings on purpose: Escape leaves the filter first, then the screen.
        before = _doubles(bindings, {})
        for key, ids in _doubles(bindings, config.keys).items():
            if ids != before.get(key) and ids not in reported:
                reported.add(ids)
                mapped = next(name for name in config.keys if name in ids)
                others = " and ".join(f'"{name}"' for name in ids if name != mapped)
                message = f'"{key}" would mean both "{mapped}" and {others} ({_place(kind)})'
                hint = f"give {others} another key, or choose another one here"
                yield Diagnostic(config.where("keys", mapped), message, hint)


def _around(kind: type[Screen[Any]]) -> list[Binding]:
    """Return what works on a screen besides its own keys: the app's, those of its table."""
    if issubclass(kind, ModalScreen):
        return []
    tables = [table for table in (CellTable, KeyedTable) if table.__name__ == kind.AUTO_FOCUS]
    return [b for part in (Dashboard, *tables) for b in all_bindings(part)]


def _doubles(bindings: Iterable[Binding], keys: Mapping[str, str]) -> dict[str, tuple[str, ...]]:
    """Return the keys with several meanings, and the ids of these."""
    found: dict[str, dict[str, None]] = {}
    for binding in bindings:
        name = binding.id or binding.action
        for key in keys.get(name, binding.key).split(","):
            plain = _character_to_key(key) if len(key) == 1 else key
            found.setdefault(plain, {})[name] = None
    return {key: tuple(sorted(ids)) for key, ids in found.items() if len(ids) > 1}
