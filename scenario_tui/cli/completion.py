"""Words that TAB offers: campaigns, runs, oracles and files of the right kind.

Names come from the ledger of this machine. Without a ledger, or if another daemon is named, no
word is offered, and the shell completes file names as usual. Errors are not printed: people are
in the middle of a line.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Final, TypeAlias

import typer

from scenario_tui.campaign_files import has_key, is_campaign

Offers: TypeAlias = Iterable[tuple[str, str]]
"""Words with explanations, for shells that show them."""
Source: TypeAlias = Callable[[typer.Context, str], Offers]
"""Function from the text typed so far to words, which need not begin with it."""
Fits: TypeAlias = Callable[[Path], bool]

_MAX_FILES: Final = 200
_WORD: Final = re.compile(r"[\w@%+=:,./~-]+\Z")
"""Words that need no quotes in a command line: shells do not quote the words they are offered."""
_NOT_PLAIN: Final = re.compile(r"[^\w.,:%/-]+")
"""Characters of an explanation that shells would interpret, such as quotes and brackets."""
_MAX_EXPLANATION: Final = 70
_FOLDER: Final = re.compile(r"[^/]+/")


def offers(*sources: Source) -> Callable[[typer.Context, str], list[tuple[str, str]]]:
    """Return a completer: the words of all sources that begin with the typed text.

    Folders are offered only if no earlier source has a word.
    """

    def offered(ctx: typer.Context, incomplete: str) -> list[tuple[str, str]]:
        matching: dict[str, str] = {}
        try:
            for source in sources:
                matching |= {
                    word: _NOT_PLAIN.sub(" ", about).strip()[:_MAX_EXPLANATION]
                    for word, about in source(ctx, incomplete)
                    if word.startswith(incomplete) and _WORD.match(word)
                    if not (matching and _FOLDER.fullmatch(word))
                }
        except Exception:  # the command itself reports the error when it is entered
            return []
        return list(matching.items())

    return offered


def words(*all_words: str) -> Source:
    """Return a source of fixed words."""
    return lambda ctx, incomplete: [(word, "") for word in all_words]


def files(*kinds: str | Fits) -> Source:
    """Return a source of files and folders; a kind is an ending, or a test of paths.

    A folder without siblings is entered at once. Without a kind there are only folders.
    """
    endings = tuple(kind for kind in kinds if isinstance(kind, str))
    tests = [kind for kind in kinds if not isinstance(kind, str)]

    def fits(path: Path) -> bool:
        return path.name.endswith(endings) or any(test(path) for test in tests)

    def source(ctx: typer.Context, incomplete: str) -> Offers:
        names = list(islice(_candidates(incomplete, fits), _MAX_FILES))
        while kinds and len(names) == 1 and names[0].endswith("/") and names[0] != incomplete:
            incomplete = names[0]
            names = list(islice(_candidates(incomplete, fits), _MAX_FILES))
        return [(name, "") for name in names]

    return source


def _candidates(incomplete: str, fits: Fits) -> Iterator[str]:
    above, _, beginning = incomplete.rpartition("/")
    typed = incomplete[: len(incomplete) - len(beginning)]
    with os.scandir(Path(typed).expanduser() if above else Path(typed or ".")) as entries:
        for entry in sorted(entries, key=lambda entry: entry.name):
            if not entry.name.startswith(beginning) or (entry.name[0] == "." and not beginning):
                continue
            if entry.is_dir():
                yield f"{typed}{entry.name}/"
            elif fits(Path(entry.path)):
                yield f"{typed}{entry.name}"


campaign_files: Final = files(is_campaign)
sut_files: Final = files(lambda path: has_key(path, "sut"))


def campaigns(ctx: typer.Context, incomplete: str) -> Offers:
    """Offer ids and names of campaigns."""
    rows = _campaigns(ctx)
    newest = {name: (name, f"the newest is {id}") for id, name, _ in reversed(rows)}
    return [*((id, about) for id, _, about in rows), *newest.values()]


def runs(ctx: typer.Context, incomplete: str) -> Offers:
    """Offer campaigns first, then the runs of the only one that matches."""
    from daemon.batch.ledger_names import runs

    beginnings = [(f"{id}.", about) for id, _, about in _campaigns(ctx)]
    matches = [one for one in beginnings if one[0].startswith(incomplete)]
    if "." not in incomplete and len(matches) != 1:
        return matches
    campaign = matches[0][0] if matches else incomplete
    return [] if _names_daemon(ctx) else runs(_ledger(ctx), campaign)


def oracles(ctx: typer.Context, incomplete: str) -> Offers:
    """Offer the oracles of the named run."""
    from daemon.batch.ledger_names import oracles

    return [] if _names_daemon(ctx) else oracles(_ledger(ctx), _argument_before(ctx, "run"))


def names_in_campaign(ctx: typer.Context, incomplete: str) -> Offers:
    """Offer scenarios, systems under test and oracles of the named campaign."""
    from daemon.batch.ledger_names import layers

    return [] if _names_daemon(ctx) else layers(_ledger(ctx), _argument_before(ctx, "campaign"))


def signals(ctx: typer.Context, incomplete: str) -> Offers:
    """Offer the signals every run has."""
    from grammars.oracle import SIGNALS

    return [(name, kind.doc) for name, kind in SIGNALS.items()]


def _argument_before(ctx: typer.Context, argument: str) -> str:
    """Return the argument of that name, also one not parsed because an option lacks its value."""
    values = ctx.params.get(argument) or ctx.args
    return values if isinstance(values, str) else values[0] if values else ""


def _campaigns(ctx: typer.Context) -> list[tuple[str, str, str]]:
    """Return id, name and a few words about every campaign of the ledger of this machine."""
    from daemon.batch.ledger_names import campaigns

    return [] if _names_daemon(ctx) else campaigns(_ledger(ctx))


def _ledger(ctx: typer.Context) -> Path:
    from daemon.batch.paths import StatePaths

    return StatePaths.find(ctx.params.get("state")).ledger


def _names_daemon(ctx: typer.Context) -> bool:
    """Return True if a daemon is named: its ledger may not be that of this machine."""
    named = ctx.params.get("connect") or os.environ.get("SCENARIO_CONNECT")
    return "connect" in ctx.params and bool(named)
