"""Files that fit what is being typed: campaigns, systems under test, traces, by what is in them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import Final, TypeAlias

from scenario_tui.files import has_key, is_campaign

Offer: TypeAlias = list[tuple[str, str]]
"""Words and what they are; shells that show explanations show both."""
Fits: TypeAlias = Callable[[Path], bool]

_MOST: Final = 200


def campaign_files(incomplete: str) -> Offer:
    """Offer YAML files that describe a campaign."""
    return _fitting(incomplete, is_campaign)


def sut_files(incomplete: str) -> Offer:
    """Offer YAML files that describe a system under test."""
    return _fitting(incomplete, lambda path: has_key(path, "sut"))


def plans_or_campaigns(incomplete: str) -> Offer:
    """Offer floor plans and campaigns."""
    plans = (".fpm", ".jsonld")
    return _fitting(incomplete, lambda path: path.suffix in plans or is_campaign(path))


def layer_files(incomplete: str) -> Offer:
    """Offer everything `scenario check` knows."""
    return with_ending(incomplete, ".yaml", ".yml", ".fpm", ".scenery", ".variation", ".jsonld")


def oracle_files(incomplete: str) -> Offer:
    """Offer oracle layers."""
    return with_ending(incomplete, ".oracles.yaml")


def variation_files(incomplete: str) -> Offer:
    """Offer variation layers."""
    return with_ending(incomplete, ".variation")


def with_ending(incomplete: str, *endings: str) -> Offer:
    """Offer files whose name ends so."""
    return _fitting(incomplete, lambda path: path.name.endswith(endings))


def folders(incomplete: str) -> Offer:
    """Offer folders."""
    return _fitting(incomplete, lambda path: False, descend=False)


def names_in(campaign: str, what: str) -> Offer:
    """Offer scenarios, or systems under test (``sut``), of a campaign file that can be run."""
    from ruamel.yaml import YAML

    body = YAML(typ="safe").load(Path(campaign))
    scenarios = {
        name: text
        for name, text in body["scenarios"].items()
        if not (isinstance(text, dict) and text.get("abstract"))
    }
    if what == "scenarios":
        return [(str(name), "scenario") for name in scenarios]
    places = [
        body,
        body.get("matrix") or {},
        *filter(lambda text: isinstance(text, dict), scenarios.values()),
    ]
    suts = [place.get("sut") or () for place in places]
    found = (name for sut in suts for name in ([sut] if isinstance(sut, str) else sut))
    return [(str(name), "system under test") for name in dict.fromkeys(found)]


def _fitting(incomplete: str, fits: Fits, *, descend: bool = True) -> Offer:
    """Offer folders to go into and files that fit; into a folder that is alone we go at once."""
    found = list(islice(_candidates(incomplete, fits), _MOST))
    while descend and len(found) == 1 and found[0].endswith("/") and found[0] != incomplete:
        incomplete = found[0]
        found = list(islice(_candidates(incomplete, fits), _MOST))
    return [(name, "") for name in found]


def _candidates(incomplete: str, fits: Fits) -> Iterator[str]:
    above, _, begun = incomplete.rpartition("/")
    typed = incomplete[: len(incomplete) - len(begun)]
    with os.scandir(Path(typed).expanduser() if above else Path(typed or ".")) as entries:
        for entry in sorted(entries, key=lambda entry: entry.name):
            if not entry.name.startswith(begun) or (entry.name[0] == "." and not begun):
                continue
            if entry.is_dir():
                yield f"{typed}{entry.name}/"
            elif fits(Path(entry.path)):
                yield f"{typed}{entry.name}"
