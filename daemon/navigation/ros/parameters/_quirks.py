"""Which oddities of the original are on: a profile by name, or one with switches turned."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, Final

from daemon.navigation.ros.parameters._findings import Finding, Path, Report
from daemon.navigation.ros.quirks import ORIGINAL, PROFILES, Quirks
from grammars.diagnostics import did_you_mean

_SWITCHES: Final = tuple(field.name for field in fields(Quirks))


def read_quirks(given: object, path: Path, report: Report) -> Quirks:
    """Return the quirks ``given``: ``original``, ``fixed``, or ``{like: PROFILE, NAME: bool}``."""
    if isinstance(given, str):
        return _profile(given, path, report)
    if not isinstance(given, Mapping):
        report.fatal.append(
            Finding(path, "must be original, fixed, or switches with true or false")
        )
        return ORIGINAL
    quirks = _profile(given.get("like", "original"), (*path, "like"), report)
    return replace(quirks, **_switched(given, path, report))


def _profile(name: object, path: Path, report: Report) -> Quirks:
    if isinstance(name, str) and name in PROFILES:
        return PROFILES[name]
    hint = did_you_mean(str(name), PROFILES)
    report.fatal.append(Finding(path, f'there are no quirks "{name}"', hint))
    return ORIGINAL


def _switched(given: Mapping[str, Any], path: Path, report: Report) -> dict[str, bool]:
    switches: dict[str, bool] = {}
    for name, value in given.items():
        place = (*path, name)
        if name == "like":
            continue
        if name not in _SWITCHES:
            hint = did_you_mean(name, _SWITCHES)
            report.fatal.append(Finding(place, f'there is no quirk "{name}"', hint))
        elif not isinstance(value, bool):
            report.fatal.append(Finding(place, f"must be true or false (given: {value!r})"))
        else:
            switches[name] = value
    return switches
