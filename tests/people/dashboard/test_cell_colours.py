"""Cells and verdicts whose words stay and whose colour changes are drawn anew."""

from rich.text import Text
from textual.app import App

from daemon.analysis.results import read_results
from daemon.model.verdicts import Evidence, Outcome, Verdict
from scenario_tui.dashboard.widgets import cell_table, tables
from scenario_tui.dashboard.widgets.cell_table import CellTable
from scenario_tui.dashboard.widgets.tables import Column, KeyedTable, VerdictList
from tests.people.dashboard.judged_campaign import judged_campaign

VERDICT = Verdict("calm", "speed <= 1 m/s", Outcome.PASS, 1.0, 1.0, "m/s", Evidence(1.0))


class Tables(App):
    def compose(self):
        yield KeyedTable((Column("phase", 0),))
        yield CellTable()
        yield VerdictList()


async def test_a_cell_of_a_table_changes_its_colour():
    async with Tables().run_test(size=(40, 20)) as pilot:
        table = pilot.app.query_one(KeyedTable)
        for colour in ("red", "blue"):
            table.fill([("a", (Text("explore", colour),))])
            assert str(table.get_row_at(0)[0].style) == colour


async def test_a_cell_of_a_matrix_changes_its_colour(monkeypatch):
    fake = judged_campaign()
    results = read_results(fake, fake._campaign_rows()[0])
    async with Tables().run_test(size=(40, 20)) as pilot:
        table = pilot.app.query_one(CellTable)
        for colour in ("red", "blue"):
            text = Text("5 of 5", colour)
            monkeypatch.setattr(cell_table, "heat_cell", lambda *_, text=text: text)
            table.show(results)
            assert str(table.get_row_at(0)[0].style) == colour


async def test_a_verdict_changes_its_colour(monkeypatch):
    async with Tables().run_test(size=(40, 20)) as pilot:
        verdicts = pilot.app.query_one(VerdictList)
        for colour in ("red", "blue"):
            text = Text("calm", colour)
            monkeypatch.setattr(tables, "verdict_text", lambda *_, text=text, **__: text)
            verdicts.show([VERDICT])
            assert str(verdicts.get_option_at_index(0).prompt.style) == colour
