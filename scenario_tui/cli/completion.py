"""What TAB offers: campaigns, runs, oracles and files that fit, instead of every file there is.

Names come from the ledger of this machine, read as it is. Without one, or with a daemon named
that keeps another, nothing is offered, and the shell completes file names as it does anywhere.
Whatever goes wrong stays unsaid: people are in the middle of a line.
"""

from __future__ import annotations

import functools
import os
import re
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Final, TypeAlias

import typer

from scenario_tui.campaign_files import has_key, is_campaign

Offer: TypeAlias = list[tuple[str, str]]
"""Words and what they are; shells that show explanations show both."""
Fits: TypeAlias = Callable[[Path], bool]

_MAX_OFFERED: Final = 200


def campaign_files(incomplete: str) -> Offer:
    """Offer YAML files that describe a campaign."""
    return _find_fitting(incomplete, is_campaign)


def sut_files(incomplete: str) -> Offer:
    """Offer YAML files that describe a system under test."""
    return _find_fitting(incomplete, lambda path: has_key(path, "sut"))


def plan_or_campaign_files(incomplete: str) -> Offer:
    """Offer floor plans and campaigns."""
    plans = (".fpm", ".jsonld", ".json", ".walls.yaml")
    return _find_fitting(incomplete, lambda path: path.name.endswith(plans) or is_campaign(path))


def plan_files(incomplete: str) -> Offer:
    """Offer floor plans."""
    return with_ending(incomplete, ".fpm", ".jsonld")


def layer_files(incomplete: str) -> Offer:
    """Offer everything `scenario check` knows."""
    plain = (".fpm", ".scenery", ".variation", ".jsonld", ".json")
    return with_ending(incomplete, ".yaml", ".yml", *plain)


def oracle_files(incomplete: str) -> Offer:
    """Offer oracle layers."""
    return with_ending(incomplete, ".oracles.yaml")


def variation_files(incomplete: str) -> Offer:
    """Offer variation layers."""
    return with_ending(incomplete, ".variation")


def with_ending(incomplete: str, *endings: str) -> Offer:
    """Offer files whose name ends so."""
    return _find_fitting(incomplete, lambda path: path.name.endswith(endings))


def folders(incomplete: str) -> Offer:
    """Offer folders."""
    return _find_fitting(incomplete, lambda path: False, descend=False)


def _find_fitting(incomplete: str, fits: Fits, *, descend: bool = True) -> Offer:
    """Offer folders to go into and files that fit; into a folder that is alone we go at once."""
    found = list(islice(_iterate_candidates(incomplete, fits), _MAX_OFFERED))
    while descend and len(found) == 1 and found[0].endswith("/") and found[0] != incomplete:
        incomplete = found[0]
        found = list(islice(_iterate_candidates(incomplete, fits), _MAX_OFFERED))
    return [(name, "") for name in found]


def _iterate_candidates(incomplete: str, fits: Fits) -> Iterator[str]:
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


Completer: TypeAlias = Callable[[typer.Context, str], Offer]
_WORD: Final = re.compile(r"[\w@%+=:,./~-]+\Z")
"""What can stand in a command line as it is: shells do not quote what they are offered."""
_NOT_PLAIN: Final = re.compile(r"[^\w.,:%/-]+")
"""What shells would take for more than words in an explanation, quotes and brackets say."""
_MAX_EXPLANATION: Final = 70


def offer_nothing_on_error(find: Completer) -> Completer:
    """Offer nothing where something is wrong: an error in the middle of a line helps nobody."""

    @functools.wraps(find)
    def offered(ctx: typer.Context, incomplete: str) -> Offer:
        try:
            return [
                (word, _NOT_PLAIN.sub(" ", about).strip()[:_MAX_EXPLANATION])
                for word, about in find(ctx, incomplete)
                if _WORD.match(word)
            ]
        except Exception:  # the command itself will say what is wrong, when it is entered
            return []

    return offered


@offer_nothing_on_error
def campaigns(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer ids and names of campaigns."""
    found = _campaigns(ctx)
    newest = {name: (name, f"the newest is {id}") for id, name, _ in reversed(found)}
    return _starting_with([*((id, about) for id, _, about in found), *newest.values()], incomplete)


@offer_nothing_on_error
def campaigns_or_results(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer campaigns, and files that ``--json`` wrote."""
    return _with_files(campaigns(ctx, incomplete), with_ending(incomplete, ".json"))


@offer_nothing_on_error
def baselines(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer what results can be held against."""
    green = [("last-green", "the last one that was as expected")]
    return [*_starting_with(green, incomplete), *campaigns_or_results(ctx, incomplete)]


@offer_nothing_on_error
def campaigns_or_folders(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer campaigns, and folders that may hold traces."""
    return _with_files(campaigns(ctx, incomplete), folders(incomplete))


@offer_nothing_on_error
def runs(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer campaigns to begin with, then the runs of the one that is meant."""
    from daemon.batch.ledger_names import runs

    beginnings = [(f"{id}.", about) for id, _, about in _campaigns(ctx)]
    meant = _starting_with(beginnings, incomplete)
    if "." not in incomplete and len(meant) != 1:
        return meant
    if _names_daemon(ctx):
        return []
    return runs(_ledger(ctx), meant[0][0] if meant else incomplete)


@offer_nothing_on_error
def runs_or_traces(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer runs, and trace files."""
    return _with_files(runs(ctx, incomplete), with_ending(incomplete, ".mcap"))


@offer_nothing_on_error
def exportable(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer whatever `scenario export` takes: plans, campaign files, and what was recorded."""
    files = [*plan_or_campaign_files(incomplete), *with_ending(incomplete, ".mcap")]
    return [*_with_files(runs(ctx, incomplete), files)]


@offer_nothing_on_error
def campaigns_runs_or_traces(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer whatever names traces: campaigns, runs, files, folders."""
    whole = [] if "." in incomplete else campaigns(ctx, incomplete)
    return [*whole, *_with_files(runs(ctx, incomplete), with_ending(incomplete, ".mcap"))]


@offer_nothing_on_error
def campaign_files_or_recorded(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer campaign files, and whatever names traces."""
    return _with_files(campaigns_runs_or_traces(ctx, incomplete), campaign_files(incomplete))


@offer_nothing_on_error
def blame_arguments(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer a run, or a campaign file; nothing for what follows it."""
    if ctx.params.get("run"):
        return []
    return _with_files(runs_or_traces(ctx, incomplete), campaign_files(incomplete))


@offer_nothing_on_error
def campaign_files_or_campaigns(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer campaign files, and what the daemon has."""
    return _with_files(campaigns(ctx, incomplete), campaign_files(incomplete))


@offer_nothing_on_error
def oracles(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer the oracles of the run that was named."""
    from daemon.batch.ledger_names import oracles

    if _names_daemon(ctx):
        return []
    return _starting_with(oracles(_ledger(ctx), _argument_before(ctx, "run")), incomplete)


@offer_nothing_on_error
def names_in_campaign(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer scenarios, systems under test and oracles of the campaign that was named."""
    from daemon.batch.ledger_names import layers

    if _names_daemon(ctx):
        return []
    return _starting_with(layers(_ledger(ctx), _argument_before(ctx, "campaign")), incomplete)


@offer_nothing_on_error
def signals(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer the signals every run has."""
    from grammars.oracle import SIGNALS

    return _starting_with([(name, kind.doc) for name, kind in SIGNALS.items()], incomplete)


def one_of(*words: str) -> Completer:
    """Return a completer of fixed words."""

    @offer_nothing_on_error
    def offered(ctx: typer.Context, incomplete: str) -> Offer:
        return [(word, "") for word in words if word.startswith(incomplete)]

    return offered


def files(find: Callable[[str], Offer]) -> Completer:
    """Return a completer of files, by a function of :mod:`scenario_tui.cli.completion`."""

    @offer_nothing_on_error
    def offered(ctx: typer.Context, incomplete: str) -> Offer:
        return find(incomplete)

    return offered


def _starting_with(found: Iterable[tuple[str, str]], incomplete: str) -> Offer:
    return [(name, about) for name, about in found if name.startswith(incomplete)]


def _with_files(names: Offer, found: Offer) -> Offer:
    """Offer names and files; folders only where somebody has begun to name one."""
    here = [one for one in found if not (names and re.fullmatch(r"[^/]+/", one[0]))]
    return list(dict([*names, *here]).items())


def _argument_before(ctx: typer.Context, argument: str) -> str:
    """Return the argument of that name; while an option lacks its value it is not taken yet."""
    said = ctx.params.get(argument) or ctx.args
    return said if isinstance(said, str) else said[0] if said else ""


def _campaigns(ctx: typer.Context) -> list[tuple[str, str, str]]:
    """Return id, name and what is said of every campaign of the ledger of this machine."""
    from daemon.batch.ledger_names import campaigns

    return [] if _names_daemon(ctx) else campaigns(_ledger(ctx))


def _ledger(ctx: typer.Context) -> Path:
    from daemon.batch.paths import StatePaths

    return StatePaths.find(ctx.params.get("state")).ledger


def _names_daemon(ctx: typer.Context) -> bool:
    """Whether somebody names a daemon, whose ledger may be another than that of this machine."""
    named = ctx.params.get("connect") or os.environ.get("SCENARIO_CONNECT")
    return "connect" in ctx.params and bool(named)
