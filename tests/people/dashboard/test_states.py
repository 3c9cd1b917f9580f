"""Every state somebody can meet: each says what is the case and what to do, at every size."""

from dataclasses import replace

import pytest

from daemon.batch.errors import Refused
from daemon.model.run_state import RunState
from tests.people.dashboard.inline import make_dashboard, press, screen_text, settle
from tests.people.fake import FakeDaemon, campaign_row, make_live, make_row

LONG = "a-campaign-whose-name-goes-on-and-on-0123456789-0123456789-0123456789"
WIDE = "走廊情景走廊情景走廊情景走廊情景走廊情景"


def gone(fake):
    fake.reachable = False


def empty(fake):
    fake.empty, fake.rows = True, ()


def stuck(fake):
    fake.trouble = "the disk of /state is full: runs wait until 32 MiB are free"


def named(fake):
    fake.rows = tuple(replace(row, scenario=WIDE, sut=LONG, oracle=LONG) for row in fake.rows)


STATES = {
    "usual": lambda fake: None,
    "gone": gone,
    "empty": empty,
    "stuck": stuck,
    "named": named,
}


def shown(pilot):
    return "\n".join(screen_text(pilot))


@pytest.fixture
def _unseen_is_not_painted():
    """Paint all there is on the way too: nothing of it may break."""


@pytest.mark.parametrize("state", STATES)
async def test_no_state_breaks_a_screen_in_the_smallest_terminal(state):
    fake = FakeDaemon(live=(make_live(7, 60.0),))
    STATES[state](fake)
    async with make_dashboard(fake).run_test(size=(40, 10)) as pilot:
        await settle(pilot)
        for keys in (("enter",), ("G", "enter"), ("1", "m"), ("2",), ("3",)):
            await press(pilot, *keys)
            lines = screen_text(pilot)
            assert lines[0].strip()[0] in "✓!…", keys
            assert len(lines) == 10
        await pilot.resize_terminal(20, 5)
        await settle(pilot)
        assert screen_text(pilot)[0].strip()


async def test_a_daemon_of_another_version_is_not_called_gone():
    fake = FakeDaemon()

    def refuse(_):
        raise Refused("the daemon's answer is not understood, versions differ? rate: missing")

    async with make_dashboard(fake).run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        fake.before = refuse
        await settle(pilot)
        assert "the daemon's answer is not understood, versions differ" in shown(pilot)
        assert "no daemon" not in shown(pilot)
        assert "first-ab12cd34" in shown(pilot)


async def test_without_an_answer_that_is_understood_the_screen_says_what_to_do():
    fake = FakeDaemon()

    def refuse(_):
        raise Refused("the daemon's answer is not understood, versions differ? rate: missing")

    fake.before = refuse
    async with make_dashboard(fake).run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        assert "versions differ" in shown(pilot)
        assert "scenario --version" in shown(pilot)


async def test_a_full_disk_is_told_on_the_first_line_and_explained_below():
    fake = FakeDaemon()
    stuck(fake)
    async with make_dashboard(fake).run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        assert "! no run can start" in shown(pilot) or "! no run starts" in shown(pilot)
        await press(pilot, "3")
        assert "the disk of /state is full" in shown(pilot)
        assert "32 MiB" in shown(pilot)


async def test_what_keeps_one_worker_from_working_is_readable_to_its_end():
    fake = FakeDaemon()
    stuck(fake)
    fake.troubles = (f"worker spare-1: {'the zygote says a lot, ' * 8}and so it ends",)
    async with make_dashboard(fake).run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        await press(pilot, "3")
        assert screen_text(pilot)[1].rstrip().endswith("…")  # cut, and looks like it
        assert "and so it ends" in " ".join(shown(pilot).split())
        assert "progress" in shown(pilot)  # and the table still has room


async def test_everything_paused_is_told_on_the_first_line():
    fake = FakeDaemon()
    rows = [replace(row, paused=True) for row in fake.campaigns()]
    fake._campaign_rows = lambda: tuple(rows)
    async with make_dashboard(fake).run_test(size=(120, 30)) as pilot:
        await settle(pilot)
        assert "‖ paused" in screen_text(pilot)[0]


async def test_thousands_of_campaigns_are_shown_as_far_as_anybody_scrolls():
    fake = FakeDaemon()
    row = make_row(0, state=RunState.DONE)
    many = tuple(campaign_row(f"c{i}", f"c{i}-00000000", (row,), 0.0) for i in range(3000))
    fake._campaign_rows = lambda: many
    async with make_dashboard(fake).run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        assert "campaigns (3000, the newest 500 shown)" in shown(pilot)
        assert "c0-00000000" in shown(pilot)


async def test_columns_give_way_before_a_table_has_to_be_scrolled_sideways():
    async with make_dashboard(FakeDaemon()).run_test(size=(40, 10)) as pilot:
        await settle(pilot)
        for keys, seen in ((("enter",), "✗ fail"), (("3",), "bench-1")):
            await press(pilot, *keys)
            table = pilot.app.screen.query_one("KeyedTable")
            assert not table.show_horizontal_scrollbar
            assert seen in shown(pilot)
