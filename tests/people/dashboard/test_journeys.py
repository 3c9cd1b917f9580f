"""Ways through campaigns, runs, matrix, searches and workers: ``journeys/NAME.txt`` tells each."""

from dataclasses import replace
from functools import partial

import pytest

from daemon.batch.errors import Refused
from daemon.model.verdicts import Outcome, RunState
from scenario_tui.dashboard import state
from scenario_tui.dashboard.config import Config
from scenario_tui.dashboard.screens import campaigns
from scenario_tui.dashboard.screens.runs import RunsScreen
from tests.people.dashboard.daemons import judged_campaign
from tests.people.dashboard.journeys import LOOK, Journey, follow, has, resized
from tests.people.dashboard.searching import SearchingDaemon, make_search
from tests.people.fake import (
    CAMPAIGN,
    NOW,
    Entered,
    FakeDaemon,
    make_live,
    make_row,
    make_rows,
)

WIDE = (120, 40)
FAILS = {"state": RunState.DONE, "outcome": Outcome.FAIL, "oracle": "no-contact", "unit": "m"}
VERDICTS = ("fail", "error", "lost", "inconclusive", "running", "queued", "pass", "local")


def typed(text):
    """Filter a table by a text: all of its letters are there at once."""
    return f"!slash {' '.join(text)}"


def changed(index, **values):
    """The rows of the campaign where one is another."""
    return lambda dash: tuple(
        replace(row, **values) if row.index == index else row for row in dash.fake.rows
    )


def away():
    return FakeDaemon(live=(make_live(7, 300.0),), away=True)


def compared_before():
    """There is an earlier campaign of the same name, in which half of the runs failed."""
    rows = tuple(
        make_row(i, id=f"nightly-0.{i}", campaign="nightly-0", outcome=outcome)
        for i, outcome in enumerate((Outcome.PASS, Outcome.FAIL) * 2)
    )
    return FakeDaemon(more=(Entered("nightly-0", "nightly", rows, NOW - 2e5),))


def more_than_are_shown():
    rows = ((f"c{n}-00000000", make_row(0, id=f"c{n}-00000000.0")) for n in range(6))
    return FakeDaemon(more=tuple(
        Entered(name, name, (replace(row, campaign=name),), NOW) for name, row in rows
    ))  # fmt: skip


def three_systems():
    fake = judged_campaign()
    more = (replace(row, sut="a-planner-with-a-long-name") for row in fake.rows if row.sut == "a2s")
    rows = enumerate((*fake.rows, *more))
    fake.rows = tuple(replace(row, id=f"{CAMPAIGN}.{i}", index=i) for i, row in rows)
    return fake


def long_names():
    names = {"scenario": "busy-house-with-many-doors", "sut": "pilot-b"}
    return FakeDaemon(tuple(make_row(i, repeat=i, **names) for i in range(4)))


def busy(count):
    """Runs under way whose worst margin goes down with their number."""
    rows = make_rows()
    running = [
        replace(rows[7], id=f"{CAMPAIGN}.{7 + i}", index=7 + i, repeat=i) for i in range(count)
    ]
    lives = (make_live(row.index, 300.0) for row in running)
    live = tuple(
        replace(one, snapshot=replace(
            one.snapshot, margin=0.5 - row.index / 20, unit="m", oracle="clear"
        ))
        for one, row in zip(lives, running, strict=True)
    )  # fmt: skip
    return FakeDaemon((*rows[:5], *running), live=live)


def begun():
    return SearchingDaemon(found=(make_search((), "running"),))


def crowded():
    words = f"worker spare-1: {'the zygote says a lot, ' * 8}and so it ends"
    trouble = "the disk of /state is full: runs wait until 32 MiB are free"
    return FakeDaemon(trouble=trouble, troubles=(words,))


def refuse(_):
    raise Refused("the daemon's answer is not understood, versions differ? rate: missing")


LONG = "a-campaign-whose-name-goes-on-and-on-0123456789-0123456789-0123456789"
STATES = {
    "gone": {"reachable": False},
    "stuck": {"trouble": "the disk of /state is full: runs wait until 32 MiB are free"},
    "named": {
        "rows": tuple(
            replace(row, scenario="走廊情景" * 3, sut=LONG, oracle=LONG, repeat=row.index)
            for row in make_rows()
        )
    },
}


def in_state(state):
    return FakeDaemon(live=(make_live(7, 60.0),), **STATES[state])


def goes_on(settled, **changes):
    """More runs of the search are over."""

    def go(dash):
        dash.fake.found = (replace(dash.fake.found[0], **changes),)
        dash.fake.go_on(settled)

    return f"{settled} runs are over", go


BROKEN = make_search((), "failed", note="campaign.yaml:3: there is no layer doors_moving")
JOURNEYS = {
    "filter-letters": Journey(
        ["slash n i", "g h", "enter", "escape", typed("qc/2s"), "escape", "enter", typed("qc/2s"),
         "escape"],
    ),
    "filter-words": Journey(
        ["enter", *(step for word in VERDICTS for step in (typed(word), "escape"))]
    ),
    "sorted": Journey([">", "i", "<", "enter", ">", ">", "i", *[">"] * (len(RunsScreen.SORTS) - 2),
                       "<"]),
    "back": Journey(
        ["2", typed("fail"), "enter", ">", ">", "i", "down", "1", "2", typed("S2/"), "enter", "1",
         "2", "1", "enter"],
    ),
    "rows-before": Journey(["enter > > down", has(rows=changed(7, margin=-9.0, **FAILS))]),
    "long-names": Journey(
        [LOOK, "2", *(resized(width, 12) for width in (92, 108, 120))], long_names, (80, 12)
    ),
    "copied": Journey(["y", "enter down y", "enter y", "escape m y", "3 y", "i", typed("pilot")]),
    "beside": Journey([LOOK, "j"], compared_before, WIDE),
    "wide": Journey([LOOK, "enter", "2", "3"], away, WIDE),
    "help": Journey(
        ["question_mark", "escape down question_mark", "escape enter question_mark",
         "escape 3 question_mark"],
        size=(100, 70), config=Config(keys={"retry": "ctrl+t"}),
    ),
    "comes-back": Journey(
        [LOOK, has(reachable=True), has(reachable=False, now=NOW + 75.0), has(reachable=True)],
        lambda: FakeDaemon(reachable=False),
    ),
    "many": Journey([LOOK], more_than_are_shown),
    **{
        f"smallest-{state}": Journey(
            [LOOK, "enter", "G enter", "1 m", "2", "3", resized(20, 5)],
            partial(in_state, state), (40, 10),
        )
        for state in STATES
    },
    "not-understood": Journey(
        [LOOK, has(before=None), "3", has(before=lambda _: refuse)],
        lambda: FakeDaemon(before=refuse),
    ),
    "troubles": Journey([LOOK, "3"], crowded),
    "matrix": Journey(
        [LOOK, "m", "j", "n", "enter", "escape a", "m", "j l",
         has(rows=changed(14, margin=-2.0, **FAILS)), resized(120, 40), "1 j m n"],
        judged_campaign,
    ),
    "matrix-of-three": Journey([LOOK, "m", resized(120, 20)], three_systems, (80, 20)),
    "matrix-of-nothing": Journey([has(rows=()), "m"], judged_campaign),
    "running": Journey([LOOK, "!tab j enter", "escape"], lambda: busy(3)),
    "running-many": Journey([LOOK], lambda: busy(20)),
    "running-no-more": Journey(
        [LOOK, "enter", "escape tab", has(rows=tuple(make_row(i) for i in range(8)))],
        lambda: busy(1),
    ),
    "search-on-its-way": Journey(
        [LOOK, "enter", goes_on(38), goes_on(60, phase="nearest")],
        lambda: SearchingDaemon.running(20), WIDE,
    ),
    "search": Journey(
        ["m", "escape", "enter n n x", "y", "N", "enter", "escape a"],
        SearchingDaemon.finished, WIDE,
    ),
    "search-parts": Journey(
        [LOOK, "enter", "tab", "tab", "escape", resized(60, 24), resized(120, 24), "2 G"],
        SearchingDaemon.finished,
    ),
    "palette": Journey(
        ["colon", "!w o r k e r s", "enter", "colon", "!c a m p a i g n space n i", "enter",
         "colon", "!i n t i m e", "enter"],
        SearchingDaemon.finished,
    ),
    "search-in-little-room": Journey(
        [LOOK, "enter", "tab", "tab", "tab"], SearchingDaemon.finished, (40, 10)
    ),
    "search-begun-and-broken": Journey(
        [LOOK, "enter", "x", "escape", has(found=(BROKEN,))], begun, WIDE
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", JOURNEYS)
async def test_a_way_through_the_dashboard_is_as_it_was(dashboard, golden, monkeypatch, name):
    for module in (state, campaigns):
        monkeypatch.setattr(module, "CAMPAIGNS_SHOWN", 5)
    way = JOURNEYS[name]
    dash = await dashboard(way.daemon(), way.size, config=way.config)
    golden(f"journeys/{name}.txt", await follow(dash, way.steps))
