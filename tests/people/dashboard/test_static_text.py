"""Texts of screens: the same one again places nothing anew, another one is shown."""

import pytest
from rich.text import Text
from textual.app import App
from textual.screen import Screen
from textual.widgets import Static

from scenario_tui.dashboard.widgets.static_text import StaticText
from tests.people.dashboard.driven import SteeredDaemon
from tests.people.dashboard.inline import make_dashboard, settle


class Page(App[None]):
    """A text as high as its words, one of a single line, and what stands below."""

    CSS = "#line { height: 1; }"

    def compose(self):
        yield StaticText(id="words")
        yield StaticText(id="line")
        yield Static("below", id="below")

    def text(self, id):
        return self.query_one(f"#{id}", StaticText)


@pytest.fixture
def placed(monkeypatch):
    """An item for each time that everything on a screen was placed anew."""
    times = []
    place = Screen._refresh_layout

    def refresh_layout(screen, *how, **more):
        times.append(None)
        place(screen, *how, **more)

    monkeypatch.setattr(Screen, "_refresh_layout", refresh_layout)
    return times


async def test_nothing_is_placed_anew_for_words_that_are_the_same_or_take_as_much(placed):
    async with Page().run_test(size=(20, 8)) as pilot:
        words, line = pilot.app.text("words"), pilot.app.text("line")
        words.update(Text("one\ntwo"))
        line.update(Text("12 s"))
        await pilot.pause()
        assert placed
        placed.clear()
        words.update(Text("one\ntwo"))
        line.update(Text("13 s"))
        await pilot.pause()
        assert not placed
        assert line.render_line(0).text.rstrip() == "13 s"


async def test_what_stands_below_gives_way_to_more_words(placed):
    async with Page().run_test(size=(20, 8)) as pilot:
        pilot.app.text("words").update(Text("one\ntwo\nthree"))
        await pilot.pause()
        assert pilot.app.query_one("#below").region.y == 4
        pilot.app.text("words").update("one")
        await pilot.pause()
        assert pilot.app.query_one("#below").region.y == 2


@pytest.mark.parametrize(
    "news",
    [Text("said", style="red"), Text.assemble(("said", "red")), Text("said, too"), "[b]said[/b]"],
)
async def test_other_words_and_other_colours_are_shown(news):
    async with Page().run_test(size=(20, 8)) as pilot:
        line = pilot.app.text("line")
        line.update(Text("said"))
        await pilot.pause()
        before = line.render_line(0)
        line.update(news)
        await pilot.pause()
        assert line.render_line(0) != before


async def test_a_dashboard_that_is_told_the_same_again_stays_as_it_is_placed(placed):
    async with make_dashboard(SteeredDaemon()).run_test(size=(120, 40)) as pilot:
        await settle(pilot)
        placed.clear()
        for _ in range(3):
            pilot.app.update_state()
            await settle(pilot)
        assert not placed
