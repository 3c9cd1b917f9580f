"""The first line answers "is it fine?" at every width, and what matters most is cut last."""

from dataclasses import replace

from daemon.model.status import Preparation, PreparationPhase, Trouble, TroubleCause
from scenario_tui.dashboard.state import DashboardState
from scenario_tui.dashboard.widgets.status_line import status_text
from scenario_tui.text.results import NONE_JUDGED, Conclusion
from scenario_tui.text.styles import KNOWN
from tests.people.fake import CAMPAIGN, NOW, OLD, FakeDaemon

SMALL = FakeDaemon().overview()
LARGE = replace(
    SMALL, done=82_469, passed=81_234, failed=1200, inconclusive=33, lost=7, errors=2,
    queued=15_000, running=64, cancelled=12, seconds_left=7500.0,
)  # fmt: skip
CAMPAIGNS = FakeDaemon().campaigns()
FINE = Conclusion("pass", "as expected", verdicts=4)
JUDGED = {CAMPAIGN: Conclusion("fail", "3 runs unexpected", 3, known=2), OLD: FINE}
HALTED = replace(LARGE, halted=True, troubles=(Trouble("the disk is full", TroubleCause.SPACE),))


def line(width, **known):
    found = DashboardState(True, at=NOW, overview=SMALL, campaigns=CAMPAIGNS, conclusions=JUDGED)
    return status_text(replace(found, **known), NOW + 75.0, width).plain


FIRST, OLDER = CAMPAIGNS
SEEN = {"acknowledged": True}
AGAIN = replace(FIRST, id="first-again", failed=0)
OVER = tuple(replace(row, queued=0, running=0) for row in CAMPAIGNS)
CANCELLED = {AGAIN.id: Conclusion("cancelled", "cancelled")}
UNJUDGED = Conclusion("running", NONE_JUDGED)
COMPILING = Preparation(PreparationPhase.COMPILING, 42)
BEGUN = replace(SMALL, passed=0, failed=0, inconclusive=0, lost=0, running=2, queued=13, rate=0.0,
                seconds_left=None, preparation=COMPILING)  # fmt: skip
NOTHING = replace(SMALL, **dict.fromkeys(
    ("queued", "running", "done", "lost", "cancelled", "passed", "failed", "inconclusive",
     "errors"), 0), seconds_left=None)  # fmt: skip
GONE = {
    "connected": False,
    "problem": "no daemon answers at tcp/127.0.0.1:7447: start one with `scenario daemon`",
}
REFUSED = {
    "connected": False, "refused": True,
    "problem": "the daemon's answer is not understood, versions differ? overview.rate: missing",
}  # fmt: skip
STATES = {
    "a small campaign": {},
    "a large one": {"overview": LARGE},
    "a full disk": {"overview": HALTED},
    "no worker": {"overview": replace(SMALL, workers=0)},
    "a worker that starts": {
        "overview": replace(SMALL, workers=0, preparation=Preparation(PreparationPhase.STARTING))
    },
    "kernels are compiled": {"overview": BEGUN, "conclusions": {}},
    "all of it over, one campaign not judged": {"campaigns": OVER, "conclusions": {OLD: FINE}},
    "all of it over, one campaign judged in part": {
        "campaigns": OVER, "conclusions": {OLD: FINE, CAMPAIGN: UNJUDGED}
    },
    "all of it over, judged before it was": {
        "campaigns": OVER, "conclusions": {OLD: FINE, CAMPAIGN: FINE}
    },
    "judged as expected before it is over": {"conclusions": {OLD: FINE, CAMPAIGN: FINE}},
    "a campaign of which nothing is judged": {"conclusions": {CAMPAIGN: UNJUDGED}},
    "a newer campaign that was cancelled": {
        "campaigns": (AGAIN, FIRST, OLDER), "conclusions": JUDGED | CANCELLED
    },
    "the same, the failure acknowledged": {
        "campaigns": (AGAIN, replace(FIRST, **SEEN), OLDER), "conclusions": JUDGED | CANCELLED
    },
    "all acknowledged": {"campaigns": tuple(replace(row, **SEEN) for row in CAMPAIGNS)},
    "one acknowledged, nothing judged": {
        "campaigns": (replace(FIRST, **SEEN), OLDER), "conclusions": {}
    },
    "failures a search was to find": {"overview": replace(SMALL, failed=0, searched=9)},
    "everything paused": {"campaigns": tuple(replace(row, paused=True) for row in CAMPAIGNS)},
    "one of two that wait paused": {
        "campaigns": (replace(FIRST, paused=True), replace(OLDER, queued=1))
    },
    "more campaigns than are listed": {"overview": replace(SMALL, campaigns=501)},
    "nothing to do": {"overview": NOTHING, "campaigns": (), "conclusions": {}},
    "the daemon is gone": GONE,
    "the daemon is not understood": REFUSED,
    "before the first answer": {"overview": None},
}  # fmt: skip
WIDTHS = (180, 120, 88, 78, 50, 38, 28, 18)


def test_the_first_line_says_whether_it_is_fine_at_every_width(golden):
    text = "\n".join(
        "\n".join([f"--- {state}", *(f"{width:3} {line(width, **known)}" for width in WIDTHS), ""])
        for state, known in STATES.items()
    )
    golden("screens/first-lines.txt", text)


def test_failures_are_red_as_long_as_they_may_be_news():
    def style(**known):
        shown = DashboardState(True, at=NOW, overview=SMALL, campaigns=CAMPAIGNS, **known)
        text = status_text(shown, NOW, 180)
        return next(
            str(one.style) for one in text.spans if "fail" in text.plain[one.start : one.end]
        )

    assert style(conclusions=JUDGED) == style(conclusions={}) == "fail"
    fine = {CAMPAIGN: Conclusion("pass", "as expected", known=2), OLD: FINE}
    assert style(conclusions=fine) == KNOWN


def test_it_never_runs_over():
    problem = "no daemon answers at tcp/127.0.0.1:7447: start one"
    refused = {"connected": False, "problem": "keys: unreadable", "refused": True}
    states = [{"overview": found} for found in (SMALL, LARGE, HALTED)]
    for known in (*states, GONE, {"connected": False, "problem": problem}, refused):
        assert all(len(line(width, **known)) <= width for width in range(1, 200))
