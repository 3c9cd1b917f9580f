"""What TAB offers: campaigns, runs, oracles and files that fit, instead of every file there is.

Names come from the ledger of this machine, read as it is, or from the daemon somebody names, which
gets a moment to answer. Without either nothing is offered, and the shell completes file names as
it does anywhere. Whatever goes wrong stays unsaid: people are in the middle of a line.
"""

from __future__ import annotations

import atexit
import functools
import os
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Final, TypeAlias, TypeVar

import typer

from scenario_tui.cli._files import Offer, campaign_files, folders, names_in, with_ending

if TYPE_CHECKING:
    import threading
    from pathlib import Path

    from daemon.client import Client
    from daemon.names import Named

Completer: TypeAlias = Callable[[typer.Context, str], Offer]
T = TypeVar("T")

PATIENCE: Final = 0.25
"""Seconds a daemon elsewhere gets to answer, loading the client included."""
_WORD: Final = re.compile(r"[\w@%+=:,./~-]+\Z")
"""What can stand in a command line as it is: shells do not quote what they are offered."""
_SAID: Final = re.compile(r"[^\w.,:%/-]+")
"""What shells would take for more than words in an explanation, quotes and brackets say."""
_SHORT: Final = 70


def quietly(find: Completer) -> Completer:
    """Offer nothing where something is wrong: an error in the middle of a line helps nobody."""

    @functools.wraps(find)
    def offered(ctx: typer.Context, incomplete: str) -> Offer:
        try:
            return [
                (word, _SAID.sub(" ", about).strip()[:_SHORT])
                for word, about in find(ctx, incomplete)
                if _WORD.match(word)
            ]
        except Exception:  # the command itself will say what is wrong, when it is entered
            return []

    return offered


@quietly
def campaigns(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer ids and names of campaigns."""
    return _beginning(_campaigns(ctx), incomplete)


@quietly
def campaigns_or_results(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer campaigns, and files that ``--json`` wrote."""
    return _or_files(campaigns(ctx, incomplete), with_ending(incomplete, ".json"))


@quietly
def baselines(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer what results can be held against."""
    green = [("last-green", "the last one that was as expected")]
    return [*_beginning(green, incomplete), *campaigns_or_results(ctx, incomplete)]


@quietly
def campaigns_or_folders(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer campaigns, and folders that may hold traces."""
    return _or_files(campaigns(ctx, incomplete), folders(incomplete))


@quietly
def runs(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer campaigns to begin with, then the runs of the one that is meant."""
    beginnings = [(f"{name}.", about) for name, about in _campaigns(ctx) if _is_id(name, about)]
    meant = _beginning(beginnings, incomplete)
    if "." not in incomplete and len(meant) != 1:
        return meant
    return list(_runs(ctx, meant[0][0] if meant else incomplete))


@quietly
def runs_or_traces(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer runs, and trace files."""
    return _or_files(runs(ctx, incomplete), with_ending(incomplete, ".mcap"))


@quietly
def recorded(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer whatever names traces: campaigns, runs, files, folders."""
    whole = [] if "." in incomplete else campaigns(ctx, incomplete)
    return [*whole, *_or_files(runs(ctx, incomplete), with_ending(incomplete, ".mcap"))]


@quietly
def planned_or_recorded(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer campaign files, and whatever names traces."""
    return _or_files(recorded(ctx, incomplete), campaign_files(incomplete))


@quietly
def blamed(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer a run, or a campaign file, then its scenarios and systems under test."""
    said = [str(word) for word in ctx.params.get("run") or ()]
    if not said:
        return _or_files(runs_or_traces(ctx, incomplete), campaign_files(incomplete))
    if not said[0].endswith((".yaml", ".yml")) or len(said) > 2:
        return []
    return _beginning(names_in(said[0], ("scenarios", "sut")[len(said) - 1]), incomplete)


@quietly
def oracles(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer the oracles of the run that was named."""
    from daemon import names

    return _beginning(names.oracles(_ledger(ctx), _said_before(ctx, "run")), incomplete)


@quietly
def mentioned(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer scenarios, systems under test and oracles of the campaign that was named."""
    from daemon import names

    campaign = _said_before(ctx, "campaign")
    return _beginning(
        names.words(_ledger(ctx), campaign, ("scenario", "sut", "oracle")), incomplete
    )


@quietly
def signals(ctx: typer.Context, incomplete: str) -> Offer:
    """Offer the signals every run has."""
    from grammars.oracle import SIGNALS

    return _beginning([(name, kind.doc) for name, kind in SIGNALS.items()], incomplete)


def one_of(*words: str) -> Completer:
    """Return a completer of fixed words."""

    @quietly
    def offered(ctx: typer.Context, incomplete: str) -> Offer:
        return [(word, "") for word in words if word.startswith(incomplete)]

    return offered


def files(find: Callable[[str], Offer]) -> Completer:
    """Return a completer of files, by a function of :mod:`scenario_tui.cli._files`."""

    @quietly
    def offered(ctx: typer.Context, incomplete: str) -> Offer:
        return find(incomplete)

    return offered


def _beginning(found: Iterable[tuple[str, str]], incomplete: str) -> Offer:
    return [(name, about) for name, about in found if name.startswith(incomplete)]


def _or_files(names: Offer, found: Offer) -> Offer:
    """Offer names and files; folders only where somebody has begun to name one."""
    here = [one for one in found if not (names and re.fullmatch(r"[^/]+/", one[0]))]
    return list(dict([*names, *here]).items())


def _said_before(ctx: typer.Context, argument: str) -> str:
    """Return the argument of that name; while an option lacks its value it is not taken yet."""
    said = ctx.params.get(argument) or ctx.args
    return said if isinstance(said, str) else said[0] if said else ""


def _is_id(name: str, about: str) -> bool:
    return not about.startswith("the newest is ")


def _campaigns(ctx: typer.Context) -> Sequence[Named]:
    from daemon import names

    endpoint = _elsewhere(ctx)
    if not endpoint:
        return names.campaigns(_ledger(ctx))
    rows = _asked(ctx, endpoint, lambda daemon: daemon.campaigns())
    found = {row.name: names.Named(row.name, f"the newest is {row.id}") for row in reversed(rows)}
    return (*(names.Named(row.id, f"{row.total} runs") for row in rows), *found.values())


def _runs(ctx: typer.Context, beginning: str) -> Sequence[Named]:
    from daemon import names

    endpoint = _elsewhere(ctx)
    if not endpoint:
        return names.runs(_ledger(ctx), beginning)
    campaign = beginning.partition(".")[0]
    page = _asked(
        ctx, endpoint, lambda daemon: daemon.runs(campaign, sort="outcome", limit=names.MOST)
    )
    return tuple(
        names.Named(row.id, f"{row.outcome or row.state} {row.scenario}/{row.sut}/{row.repeat}")
        for row in page.rows
        if row.id.startswith(beginning)
    )


def _ledger(ctx: typer.Context) -> Path:
    from daemon.places import Places

    return Places.find(ctx.params.get("state")).ledger


def _elsewhere(ctx: typer.Context) -> str:
    """Return the endpoint somebody named; commands that read the ledger have no such option."""
    if "connect" not in ctx.params:
        return ""
    return str(ctx.params["connect"] or os.environ.get("SCENARIO_CONNECT") or "")


def _asked(ctx: typer.Context, endpoint: str, ask: Callable[[Client], T]) -> T:
    """Ask a daemon in a thread, left behind when it takes long; raises without an answer."""
    import queue
    import threading

    keys: Path | None = ctx.params.get("keys")
    answers: queue.SimpleQueue[tuple[T, ...]] = queue.SimpleQueue()

    def work() -> None:
        from daemon.client import Client

        # That no answer comes says it all.
        with suppress(Exception), Client.open(endpoint, timeout=PATIENCE, keys=keys) as daemon:
            answers.put((ask(daemon),))
        answers.put(())

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    atexit.register(_leave_at_once, thread)
    (answer,) = answers.get(timeout=PATIENCE)
    return answer


def _leave_at_once(thread: threading.Thread) -> None:
    """End before a thread does that still waits: the interpreter would complain about it."""
    if thread.is_alive():
        sys.stdout.flush()
        os._exit(0)
