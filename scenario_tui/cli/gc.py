"""The command that frees space: traces of finished campaigns, and unused files."""

from __future__ import annotations

import time
from collections import defaultdict
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.batch.amounts import parse_size, parse_time, size_text
from grammars.text.words import count_noun
from scenario_tui.cli.answer import Answer
from scenario_tui.cli.options import State
from scenario_tui.cli.output import print_line

if TYPE_CHECKING:
    from daemon.batch.ledger import Removal


def _parse_age(text: str) -> float:
    """Return ``30d`` in seconds; raises ``ValueError``."""
    return parse_time(text, "an age", "30d")


def gc(
    keep: Annotated[
        int | None, typer.Option(min=0, help="Keep the traces of this many finished campaigns.")
    ] = None,
    older_than: Annotated[
        float | None,
        typer.Option(metavar="AGE", parser=_parse_age, help="Remove older traces: 30d, 12h."),
    ] = None,
    max_size: Annotated[
        int | None,
        typer.Option(metavar="SIZE", parser=parse_size, help="Remove until they fit: 20GiB."),
    ] = None,
    dry_run: Annotated[bool, "-n", "List what would go; remove nothing."] = False,
    state: State = None,
) -> Answer[Removal]:
    """Remove unused files, and the oldest traces of finished campaigns.

    Traces go by the options only; their results stay and say that the trace is gone. Unused files
    always go: temporary files, abandoned uploads, scenes and files of no campaign, spools of dead
    workers. A daemon may be running.
    """
    from daemon.batch.ledger import (
        Removal,
        RetentionPolicy,
        find_strays,
        remove_strays,
        sweep_traces,
    )
    from daemon.batch.paths import StatePaths

    paths, policy = StatePaths.find(state), RetentionPolicy(keep, older_than, max_size)
    swept = sweep_traces(paths, policy, time.time(), dry=dry_run)
    strays = (find_strays if dry_run else remove_strays)(paths, time.time())
    value = Removal(paths.state, dry_run, swept.freed, swept.rest, swept.traces, strays)
    return Answer("gc", value, partial(_print_removal, value))


def _print_removal(removal: Removal) -> None:
    """Print a line for each campaign and stray file, and a total."""
    sizes = defaultdict[str, list[int]](list)
    for trace in removal.traces:
        sizes[trace.campaign].append(trace.size)
    lines = [
        f"{campaign}  {count_noun(len(of), 'trace')}  {size_text(sum(of))}"
        for campaign, of in sizes.items()
    ]
    lines += [f"{one.what}  {one.path}  {size_text(one.bytes)}" for one in removal.strays]
    verb = "would remove" if removal.dry_run else "removed"
    total = f"{verb} {count_noun(len(removal.traces), 'trace')}, {size_text(removal.freed)}"
    total += f"; {size_text(removal.kept)} of traces stay"
    if removal.strays:
        size = size_text(sum(stray.bytes for stray in removal.strays))
        total += f"; {count_noun(len(removal.strays), 'stray')}, {size}"
    for line in (*lines, total):
        print_line(line)
