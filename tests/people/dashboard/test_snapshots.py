"""What the screens look like, with fixed data and a fixed clock."""

import pytest

from tests.people.dashboard.inline import make_dashboard, press, settle
from tests.people.dashboard.judged_campaign import judged_campaign
from tests.people.dashboard.searching import SearchingDaemon
from tests.people.dashboard.test_states import STATES
from tests.people.fake import WAITING, FakeDaemon, make_live

NARROW, WIDE = (80, 24), (120, 40)
SCREENS = {
    "campaigns": (),
    "runs": ("enter", "j", "j", "j", "j", "j"),
    "failed-run": ("enter", "j", "j", "j", "j", "j", "enter"),
    "running-run": ("enter", "j", "j", "j", "j", "j", "j", "j", "enter"),
}
SHOTS = [(screen, NARROW) for screen in SCREENS] + [("runs", WIDE), ("running-run", WIDE)]


@pytest.mark.parametrize(
    ("screen", "size"), SHOTS, ids=[f"{screen}-{size[0]}x{size[1]}" for screen, size in SHOTS]
)
def test_screen(snap_compare, screen, size):
    fake = FakeDaemon(live=tuple(make_live(7, float(t)) for t in range(0, 61, 2)))

    async def before(pilot):
        await settle(pilot)
        await press(pilot, *SCREENS[screen])

    assert snap_compare(make_dashboard(fake), terminal_size=size, run_before=before)


@pytest.mark.parametrize(
    ("screen", "size"),
    [("running-run", NARROW), ("running-run", WIDE), ("runs", WIDE)],
    ids=["running-run-80x24", "running-run-120x40", "runs-120x40"],
)
def test_a_system_that_is_being_started(snap_compare, screen, size):
    fake = FakeDaemon(live=(make_live(7, waiting=WAITING),))
    keys = SCREENS[screen] if screen != "runs" else ("enter", *["j"] * 7)

    async def before(pilot):
        await settle(pilot)
        await press(pilot, *keys)

    assert snap_compare(make_dashboard(fake), terminal_size=size, run_before=before)


@pytest.mark.parametrize("size", [NARROW, WIDE], ids=["80x24", "120x40"])
def test_the_matrix(snap_compare, size):
    async def before(pilot):
        await settle(pilot)
        await press(pilot, "m", "n")

    dashboard = make_dashboard(judged_campaign())
    assert snap_compare(dashboard, terminal_size=size, run_before=before)


@pytest.mark.parametrize(
    ("size", "keys"),
    [(NARROW, ()), (NARROW, ("tab",)), (WIDE, ("n", "n"))],
    ids=["80x24", "values-80x24", "120x40"],
)
def test_a_search(snap_compare, size, keys):
    async def before(pilot):
        await settle(pilot)
        await press(pilot, "enter", *keys)

    dashboard = make_dashboard(SearchingDaemon.finished())
    assert snap_compare(dashboard, terminal_size=size, run_before=before)


def test_a_gone_daemon(snap_compare):
    fake = FakeDaemon()

    async def before(pilot):
        await settle(pilot)
        fake.reachable = False
        fake.now += 75.0
        await settle(pilot)

    assert snap_compare(make_dashboard(fake), terminal_size=NARROW, run_before=before)


@pytest.mark.parametrize("state", ["gone", "empty", "stuck"])
@pytest.mark.parametrize("size", [NARROW, WIDE], ids=["80x24", "120x40"])
def test_a_state(snap_compare, state, size):
    fake = FakeDaemon()
    STATES[state](fake)
    assert snap_compare(make_dashboard(fake), terminal_size=size, run_before=settle)


def test_the_smallest_terminal(snap_compare):
    async def before(pilot):
        await settle(pilot)
        await press(pilot, "enter")

    assert snap_compare(make_dashboard(FakeDaemon()), terminal_size=(40, 10), run_before=before)
