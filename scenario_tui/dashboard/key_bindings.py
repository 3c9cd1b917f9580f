"""Every key of the dashboard by its id: what ``config.toml`` may map, and what help lists."""

from __future__ import annotations

import pkgutil
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Final

from textual.app import App
from textual.dom import DOMNode
from textual.keys import Keys, _character_to_key
from textual.screen import Screen

import scenario_tui.dashboard
from grammars.text.diagnostics import Finding, InputError, Where
from scenario_tui.dashboard.app import Dashboard
from scenario_tui.dashboard.config import Config
from scenario_tui.dashboard.screens.help import (
    binding_meaning,
    our_classes,
    own_bindings,
)
from scenario_tui.dashboard.themes import DARK, LIGHT

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
    places = {"base": "every screen", "steering": "every campaign", "filtering": "every table"}
    return places.get(name, name)


def check_config(config: Config) -> None:
    """Check the names of keys and themes; raises :class:`InputError` for unknown ones."""
    from textual.theme import BUILTIN_THEMES

    where = Where(str(config.path))
    themes = sorted((*BUILTIN_THEMES, DARK, LIGHT))
    if config.theme and config.theme not in themes:
        message = f'unknown theme "{config.theme}"; themes are {", ".join(themes)}'
        raise InputError(Finding(where, message))
    # Finding all keys loads every screen.
    if config.keys:
        problems = [*_unknown_ids(config, where), *_unknown_keys(config, where)]
        if problems:
            raise InputError(problems)


def _unknown_ids(config: Config, where: Where) -> Iterator[Finding]:
    ids = sorted({bound.id for bound in list_key_bindings()})
    for name in config.keys:
        if name not in ids:
            message = f'unknown key id "{name}"; ids are {", ".join(ids)}'
            yield Finding(where, message, "`scenario tui --bindings` says what they do")


def _unknown_keys(config: Config, where: Where) -> Iterator[Finding]:
    # Textual takes any name and then waits for a key that never comes.
    known = {key.value.rpartition("+")[2] for key in Keys}
    known |= {_character_to_key(chr(code)) for code in range(33, 127)}
    for name, keys in config.keys.items():
        for key in keys.split(","):
            *modifiers, last = key.split("+")
            if not (set(modifiers) <= _MODIFIERS and (len(last) == 1 or last in known)):
                message = f'{name}: "{key}" is no key'
                hint = 'keys are like "x", "X", "f5", "ctrl+d" or "slash"'
                yield Finding(where, message, hint)
