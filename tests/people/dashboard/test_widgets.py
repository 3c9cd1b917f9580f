"""Widgets that draw again what changed: cells, verdicts and texts, also in their colours alone."""

import pytest
from rich.text import Text
from textual.app import App
from textual.widgets import Static

from daemon.analysis.results import read_results
from daemon.model.verdicts import Evidence, Outcome, Verdict
from scenario_tui.dashboard.widgets import cell_table, tables
from scenario_tui.dashboard.widgets.cell_table import CellTable
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.dashboard.widgets.tables import Column, KeyedTable, VerdictList
from tests.people.dashboard.daemons import judged_campaign

VERDICT = Verdict("calm", "speed <= 1 m/s", Outcome.PASS, 1.0, 1.0, "m/s", Evidence(1.0))


class Page(App):
    """Tables, a text as high as its words, one of a single line, and what stands below."""

    CSS = "#line { height: 1; }"

    def compose(self):
        yield StaticText(id="words")
        yield StaticText(id="line")
        yield Static("below", id="below")
        yield KeyedTable((Column("phase", 0),))
        yield CellTable()
        yield VerdictList()


def table_cell(page, text):
    table = page.query_one(KeyedTable)
    table.fill([("a", (text,))])
    return table.get_row_at(0)[0]


def matrix_cell(page, text):
    fake = judged_campaign()
    table = page.query_one(CellTable)
    table.show(read_results(fake, fake.campaigns()[0]))
    return table.get_row_at(0)[0]


def verdict(page, text):
    verdicts = page.query_one(VerdictList)
    verdicts.show([VERDICT])
    return verdicts.get_option_at_index(0).prompt


@pytest.mark.parametrize("draw", [table_cell, matrix_cell, verdict])
async def test_words_that_stay_change_their_colour(dashboard, monkeypatch, draw):
    dash = await dashboard(Page(), (40, 20))
    for colour in ("red", "blue"):
        text = Text("5 of 5", colour)
        monkeypatch.setattr(cell_table, "heat_cell", lambda *_, text=text: text)
        monkeypatch.setattr(tables, "verdict_text", lambda *_, text=text, **__: text)
        assert str(draw(dash.app, text).style) == colour


async def test_what_stands_below_gives_way_to_more_words(dashboard):
    dash = await dashboard(Page(), (20, 8))
    for text, below in (("one\ntwo\nthree", 4), ("one", 2)):
        dash.one("#words").update(Text(text))
        await dash.settle()
        assert dash.one("#below").region.y == below


@pytest.mark.parametrize(
    "news",
    [Text("said", style="red"), Text.assemble(("said", "red")), Text("said, too"), "[b]said[/b]"],
)
async def test_other_words_and_other_colours_are_shown(dashboard, news):
    dash = await dashboard(Page(), (20, 8))
    line = dash.one("#line")
    line.update(Text("said"))
    await dash.settle()
    before = line.render_line(0)
    line.update(news)
    await dash.settle()
    assert line.render_line(0) != before
