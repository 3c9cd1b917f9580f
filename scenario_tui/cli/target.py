"""Names that moved to :mod:`scenario_tui.source`, until every command gets its target as an answer.

A target that a command makes itself speaks to the terminal.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from scenario_tui import source
from scenario_tui.cli.output import say, show_progress
from scenario_tui.source import find_campaign, find_campaign_or_search, find_run

if TYPE_CHECKING:
    from daemon.analysis.recorded import Progress

__all__ = ["DaemonTarget", "find_campaign", "find_campaign_or_search", "find_run"]


@dataclass(frozen=True, slots=True)
class DaemonTarget(source.DaemonTarget):
    """A target that tells people of itself on the terminal."""

    say: Callable[[str], None] = say
    progress: Progress = show_progress
