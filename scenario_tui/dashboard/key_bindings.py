"""Every key of the dashboard by its id, for ``config.toml``."""

from __future__ import annotations

import pkgutil
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Final

from textual.app import App
from textual.binding import Binding
from textual.dom import DOMNode
from textual.keys import Keys, _character_to_key
from textual.screen import Screen

import scenario_tui.dashboard
from grammars.text.diagnostics import Finding, InputError, Where
from scenario_tui.dashboard.app import Dashboard
from scenario_tui.dashboard.config import Config
from scenario_tui.dashboard.themes import DARK, LIGHT

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
    listed = [
        KeyBinding(one.id, one.key, _place(kind), f"{one.description}: {one.tooltip}")
        for kind in classes_with_bindings()
        for one in vars(kind)["BINDINGS"]
        if isinstance(one, Binding) and one.id
    ]
    return tuple(dict.fromkeys(listed))


def classes_with_bindings() -> tuple[type[DOMNode], ...]:
    """Return all of our screens and widgets that bind keys, the dashboard first."""
    kinds: dict[type[DOMNode], None] = dict.fromkeys(Dashboard.__mro__)
    for part in ("screens", "widgets"):
        package = import_module(f"{scenario_tui.dashboard.__name__}.{part}")
        for module in pkgutil.iter_modules(package.__path__):
            members = vars(import_module(f"{package.__name__}.{module.name}")).values()
            kinds |= dict.fromkeys(one for one in members if isinstance(one, type))
    ours = (kind for kind in kinds if kind.__module__.startswith(f"{scenario_tui.__name__}."))
    return tuple(kind for kind in ours if issubclass(kind, DOMNode) and "BINDINGS" in vars(kind))


def _place(kind: type[DOMNode]) -> str:
    if issubclass(kind, App):
        return "everywhere"
    if not issubclass(kind, Screen):
        return "tables"
    name = kind.__module__.rpartition(".")[2]
    places = {"base": "every screen", "steering": "every campaign", "filtering": "every table"}
    of_class = {"MapActions": "maps", "Help": "help"}
    return of_class.get(kind.__name__) or places.get(name, name)


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
            yield Finding(where, message, "`scenario tui --bindings` explains them")


def _unknown_keys(config: Config, where: Where) -> Iterator[Finding]:
    # Textual accepts any name, also of a key that does not exist.
    names = {key.value.rpartition("+")[2] for key in Keys}
    names |= {_character_to_key(chr(code)) for code in range(33, 127)}
    for name, keys in config.keys.items():
        for key in keys.split(","):
            *modifiers, last = key.split("+")
            if not (set(modifiers) <= _MODIFIERS and (len(last) == 1 or last in names)):
                message = f'{name}: "{key}" is not a key'
                hint = 'keys are like "x", "X", "f5", "ctrl+d" or "slash"'
                yield Finding(where, message, hint)
