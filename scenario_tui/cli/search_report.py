"""The page of a search: its runs and its traces, from a ledger or a daemon."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from daemon.batch.errors import Refused, TraceUnavailable
from scenario_tui.source import find_campaign_or_search

if TYPE_CHECKING:
    from daemon.model.search_answer import SearchRow
    from daemon.model.status import RunRow
    from daemon.model.verbs import CampaignSource


@dataclass(frozen=True, slots=True)
class SearchMaterial:
    """A search for its page: its runs, and the files of traces by run."""

    row: SearchRow
    proposals: tuple[RunRow, ...]
    traces: Mapping[str, Path]


def find_search_id(source: CampaignSource, name: str) -> str:
    """Return the id of a search by that id, its beginning, or its name in the campaign file.

    Empty for a campaign. Raises :class:`Refused` if there is neither.
    """
    row = find_campaign_or_search(source, name)
    return row.id if row.search else ""


def ask_search(
    source: CampaignSource, campaign: str, *, runs: bool = True
) -> tuple[SearchRow, tuple[RunRow, ...]]:
    """Return a search, with its ``runs`` if asked; raises :class:`Refused` if there is none."""
    row = source.search_row(campaign)
    if row is None:
        raise Refused(f"there is no search {campaign}")
    return row, source.all_runs(campaign, results=True) if runs else ()


def search_material(
    source: CampaignSource, row: SearchRow, proposals: tuple[RunRow, ...]
) -> SearchMaterial:
    """Return what the page of a search needs; the traces that it draws are brought here."""
    from daemon.batch.stores import local_copy, trace_reference
    from daemon.model.verbs import DaemonClient

    daemon = source if isinstance(source, DaemonClient) else None
    shown = row.answer.shown if row.answer is not None else None
    traces: dict[str, Path] = {}
    # A trace that is gone leaves its pictures out.
    with suppress(TraceUnavailable, Refused):
        if shown is not None and shown.run:
            traces[shown.run] = local_copy(trace_reference(source.run(shown.run).row), daemon)
    return SearchMaterial(row, proposals, traces)


def write_search_page(material: SearchMaterial, page: Path) -> None:
    """Write the page of a search."""
    from daemon.search.page import search_page
    from scenario_tui.text.search_text import search_commands

    row = material.row
    commands = search_commands(row)
    text = search_page(row, material.proposals, traces=material.traces, commands=commands)
    page.write_text(text, encoding="utf-8")
