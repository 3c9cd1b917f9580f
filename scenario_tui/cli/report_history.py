"""The history of a campaign: all submissions of its name, as a page and as JSON."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from daemon.analysis.history import CampaignHistory, read_history
from scenario_tui.cli.output import Output, stdout_console
from scenario_tui.cli.target import find_campaign

if TYPE_CHECKING:
    from scenario_tui.cli.target import DaemonTarget


class HistoryOutput(Output, schema="history"):
    """The submissions of a campaign, the oldest first, and the page that was written about them."""

    answer: str
    history: CampaignHistory
    written: dict[str, str]


def report_history(campaign: str, page: Path, target: DaemonTarget, *, as_json: bool) -> None:
    """Write the page of a campaign's history and print what is new.

    Raises :class:`daemon.batch.errors.Refused` if there is no such campaign.
    """
    from daemon.analysis.history_page import history_page
    from daemon.batch.ledger import LedgerReader

    with target.open() if target.named else LedgerReader.open(target.paths) as source:
        history = read_history(source, find_campaign(source, campaign).name)
    page.write_text(history_page(history), encoding="utf-8")
    if as_json:
        HistoryOutput(history.headline, history, {"page": str(page)}).emit()
        return
    console = stdout_console()
    console.print(f"{history.name}: {history.headline}", markup=False, soft_wrap=True)
    console.print(f"{page} ({page.stat().st_size / 1e6:.2f} MB)", markup=False, soft_wrap=True)
