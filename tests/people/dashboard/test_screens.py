"""Each screen as a reader sees it, with fixed data and a fixed clock: ``screens/NAME-SIZE.txt``."""

from dataclasses import dataclass

import pytest
from textual.app import App

from scenario_tui.dashboard.playback import open_playback
from scenario_tui.dashboard.screens.compare import CompareScreen
from scenario_tui.dashboard.screens.replay import ReplayScreen
from scenario_tui.dashboard.screens.standalone import StandaloneApp
from tests.people.dashboard.daemons import RecordedDaemon, judged_campaign
from tests.people.dashboard.searching import SearchingDaemon
from tests.people.fake import CAMPAIGN, WAITING, FakeDaemon, make_judgement, make_live
from tests.people.recorded import HIT, record_run

NARROW, WIDE = (80, 24), (120, 40)
TO_FAILED = ("enter", *["j"] * 5)
TO_RUNNING = ("enter", *["j"] * 7)


@pytest.fixture(scope="module")
def trace(tmp_path_factory):
    folder = tmp_path_factory.mktemp("traces")
    record_run(folder / "near.mcap", speed=0.1)
    return record_run(folder / "run.mcap")


def usual(_):
    return FakeDaemon(live=tuple(make_live(7, float(t)) for t in range(0, 61, 2)))


def judged(_):
    fake = usual(_)
    fake.judged[f"{CAMPAIGN}.7"] = make_judgement()
    return fake


def failing(_):
    fake = usual(_)
    fake.judged[f"{CAMPAIGN}.7"] = make_judgement(contact=True)
    return fake


def starting(_):
    return FakeDaemon(live=(make_live(7, waiting=WAITING),))


def away(_):
    return FakeDaemon(live=(make_live(7, 300.0),), away=True)


def gone(_):
    return FakeDaemon(reachable=False)


def empty(_):
    return FakeDaemon(empty=True, rows=())


def stuck(_):
    return FakeDaemon(trouble="the disk of /state is full: runs wait until 32 MiB are free")


def compared(trace):
    far, near = open_playback(trace), open_playback(trace.with_name("near.mcap"))
    return StandaloneApp(CompareScreen(far, near, clock=lambda: 0.0))


def replayed(trace):
    return StandaloneApp(ReplayScreen(open_playback(trace), HIT, clock=lambda: 0.0))


@dataclass(frozen=True)
class Screen:
    """A screen: the keys that lead to it, what is behind it, in which sizes it is looked at."""

    keys: tuple = ()
    behind: object = usual
    sizes: tuple = (NARROW,)


SCREENS = {
    "campaigns": Screen(sizes=(NARROW, WIDE)),
    "runs": Screen(TO_FAILED, sizes=(NARROW, WIDE, (40, 10))),
    "all-runs": Screen(("2",), sizes=((120, 30),)),
    "workers": Screen(("3",), away, ((120, 30),)),
    "failed-run": Screen((*TO_FAILED, "enter")),
    "failed-run-log": Screen((*TO_FAILED, "enter", "shift+tab")),
    "running-run": Screen((*TO_RUNNING, "enter"), sizes=(NARROW, WIDE)),
    "judged-run": Screen((*TO_RUNNING, "enter"), judged, (WIDE,)),
    "failing-run": Screen((*TO_RUNNING, "enter"), failing, ((150, 40),)),
    "starting-runs": Screen(TO_RUNNING, starting, (WIDE,)),
    "starting-run": Screen((*TO_RUNNING, "enter"), starting, (NARROW, WIDE)),
    "recorded-run": Screen((*TO_FAILED, "enter"), RecordedDaemon),
    "recorded-run-signals": Screen((*TO_FAILED, "enter", "tab"), RecordedDaemon),
    "recorded-run-map": Screen((*TO_FAILED, "enter", "tab", "tab"), RecordedDaemon),
    "matrix": Screen(("m", "n"), lambda _: judged_campaign(), (NARROW, WIDE)),
    "search": Screen(("enter",), lambda _: SearchingDaemon.finished()),
    "search-values": Screen(("enter", "tab"), lambda _: SearchingDaemon.finished()),
    "search-nearest": Screen(("enter", "n", "n"), lambda _: SearchingDaemon.finished(), (WIDE,)),
    "searches": Screen((), lambda _: SearchingDaemon.running(), (WIDE,)),
    "cancel": Screen(("c",)),
    "retry": Screen(("r",)),
    "priority": Screen(("number_sign",)),
    "help": Screen(("enter", "question_mark"), sizes=((100, 70),)),
    "gone": Screen((), gone),
    "empty": Screen((), empty, (NARROW, WIDE)),
    "empty-runs": Screen(("2",), empty),
    "stuck": Screen(("3",), stuck),
    "replay": Screen((), replayed),
    "comparison": Screen(("n",), compared, (NARROW, WIDE)),
    "comparison-signals": Screen(("n", "tab"), compared),
    "comparison-verdicts": Screen(("n", "tab", "tab"), compared),
}


@pytest.mark.parametrize(
    ("name", "size"), [(name, size) for name, screen in SCREENS.items() for size in screen.sizes]
)
async def test_a_screen_shows_what_it_did(dashboard, golden, trace, name, size):
    screen = SCREENS[name]
    behind = screen.behind(trace)
    dash = await dashboard(behind, size)
    await dash.press(*screen.keys)
    if not isinstance(behind, App):
        await dash.read()
    golden(f"screens/{name}-{size[0]}x{size[1]}.txt", f"{dash.text.rstrip()}\n")


async def test_old_data_stays_on_the_screen_with_its_age(dashboard, fake, golden):
    dash = await dashboard()
    fake.reachable = False
    fake.now += 75.0
    await dash.settle()
    assert dash.screen.has_class("-stale")
    golden("screens/lost-80x24.txt", f"{dash.text.rstrip()}\n")
    fake.reachable = True
    await dash.settle()
    assert "✗ first: 2 unexpected" in dash.lines[0]
    assert not dash.screen.has_class("-stale")


@pytest.mark.parametrize(
    ("name", "behind", "keys"),
    [("runs", usual, TO_FAILED), ("matrix", lambda _: judged_campaign(), ("m", "n"))],
)
async def test_words_have_their_colours(dashboard, golden, name, behind, keys):
    dash = await dashboard(behind(None))
    await dash.press(*keys)
    lines = [
        "".join(f"{segment.style}: {segment.text}\n" for segment in strip if segment.text.strip())
        for strip in dash.strips
    ]
    golden(f"screens/{name}-colours.txt", "\n".join(lines))
