"""States somebody can meet: each screen says what is the case and what to do, at every size."""

from dataclasses import replace

import pytest

from daemon.batch.errors import Refused
from scenario_tui.dashboard.widgets.tables import KeyedTable
from tests.people.fake import NOW, Entered, FakeDaemon, make_live, make_row

LONG = "a-campaign-whose-name-goes-on-and-on-0123456789-0123456789-0123456789"
WIDE = "走廊情景走廊情景走廊"
STATES = {
    "usual": {},
    "gone": {"reachable": False},
    "empty": {"empty": True, "rows": ()},
    "stuck": {"trouble": "the disk of /state is full: runs wait until 32 MiB are free"},
    "named": {
        "rows": tuple(
            replace(row, scenario=WIDE, sut=LONG, oracle=LONG, repeat=row.index)
            for row in FakeDaemon().rows
        )
    },
}


@pytest.fixture
def _unseen_is_not_painted():
    """Paint all there is on the way too: nothing of it may break."""


@pytest.mark.parametrize("state", STATES)
async def test_no_state_breaks_a_screen_in_the_smallest_terminal(dashboard, state):
    dash = await dashboard(FakeDaemon(live=(make_live(7, 60.0),), **STATES[state]), (40, 10))
    for keys in (("enter",), ("G", "enter"), ("1", "m"), ("2",), ("3",)):
        await dash.press(*keys)
        assert dash.lines[0].strip()[0] in "✓!…", keys
        assert len(dash.lines) == 10
    await dash.resize(20, 5)
    assert dash.lines[0].strip()


@pytest.mark.parametrize("begun", [True, False])
async def test_a_daemon_of_another_version_is_not_called_gone(dashboard, fake, begun):
    def refuse(_):
        raise Refused("the daemon's answer is not understood, versions differ? rate: missing")

    fake.before = None if begun else refuse
    dash = await dashboard()
    fake.before = refuse
    await dash.settle()
    assert "the daemon's answer is not understood, versions differ" in dash.text
    assert "no daemon" not in dash.text
    assert ("first-ab12cd34" if begun else "scenario --version") in dash.text


async def test_what_keeps_one_worker_from_working_is_readable_to_its_end(dashboard, fake):
    fake.trouble = STATES["stuck"]["trouble"]
    fake.troubles = (f"worker spare-1: {'the zygote says a lot, ' * 8}and so it ends",)
    dash = await dashboard()
    await dash.press("3")
    assert dash.lines[1].rstrip().endswith("…")  # cut, and looks like it
    assert "and so it ends" in dash.words
    assert "progress" in dash.text  # and the table still has room


async def test_thousands_of_campaigns_are_shown_as_far_as_anybody_scrolls(dashboard, fake):
    fake.more = tuple(
        Entered(name, name, (make_row(0, id=f"{name}.0", campaign=name),), NOW)
        for name in (f"c{number}-00000000" for number in range(600))
    )
    dash = await dashboard()
    assert "campaigns (602, the newest 500 shown)" in dash.text
    assert "c599-00000000" in dash.text


@pytest.mark.parametrize(("size", "run"), [((40, 10), "✗ fail"), ((80, 24), "no-contact")])
async def test_columns_give_way_before_a_table_has_to_be_scrolled_sideways(dashboard, size, run):
    dash = await dashboard(size=size)
    for keys, seen in (((), "first-"), (("enter",), run), (("2",), "S2/"), (("3",), "bench-1")):
        await dash.press(*keys)
        assert dash.one(KeyedTable).max_scroll_x == 0
        assert seen in dash.text
