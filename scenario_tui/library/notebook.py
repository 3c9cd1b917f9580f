"""Campaigns and results in notebooks: the tables and sentences of the terminal, as HTML."""

from __future__ import annotations

import io
from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

from rich.console import RenderableType
from rich.terminal_theme import TerminalTheme
from rich.text import Text

from grammars.text.words import NOTHING, count_noun
from scenario_tui.terminal.printable_console import PrintableConsole
from scenario_tui.text.formatting import plain_table

if TYPE_CHECKING:
    from daemon.analysis.results import CampaignResults
    from daemon.campaign import Campaign

# Readable on white and on black. Text without a colour gets that of the notebook.
_GREY: Final = (128, 128, 128)
_COLOURS: Final = [
    _GREY, (217, 72, 72), (46, 150, 80), (176, 126, 18), (64, 124, 214), (168, 92, 200),
    (26, 148, 162), _GREY,
]  # fmt: skip
_THEME: Final = TerminalTheme(_GREY, _GREY, _COLOURS)
_PAGE: Final = (
    '<pre style="line-height:1.35;background:none;overflow-x:auto;'
    "font-family:Menlo,'DejaVu Sans Mono',consolas,'Courier New',monospace\">{code}</pre>"
)
_WIDTH: Final = 120
"""Columns of a table; notebooks scroll wider ones."""


def campaign_html(campaign: Campaign) -> str:
    """Return the cells of a campaign with the number of their runs."""
    runs: dict[tuple[str, str], int] = {}
    for cell in campaign.cells:
        runs |= {(cell.name, sut.name): campaign.repeats_with(sut) for sut in cell.suts}
    systems = tuple(dict.fromkeys(system for _, system in runs))
    table = plain_table("scenario", *systems)
    for cell in campaign.cells:
        counts = (runs.get((cell.name, system)) for system in systems)
        table.add_row(cell.name, *(count_noun(n, "run") if n else NOTHING for n in counts))
    about = f"  {campaign.about}" if campaign.about else ""
    head = Text.assemble((campaign.name, "bold"), (about, "dim"))
    return _html((head, count_noun(campaign.runs, "run"), "", table))


def results_html(results: CampaignResults) -> str:
    """Return what ``scenario results`` prints."""
    from scenario_tui.text.summary import summary_parts

    return _html(summary_parts(results))


def _html(parts: Iterable[RenderableType]) -> str:
    console = PrintableConsole(
        file=io.StringIO(), record=True, width=_WIDTH, force_jupyter=False, legacy_windows=False
    )
    for part in parts:
        console.print(part, crop=False)
    return console.export_html(theme=_THEME, code_format=_PAGE, inline_styles=True)
