"""The dashboard without a thread: the feed asks the fake daemon whenever the screen looks."""

import asyncio
import itertools
import time
from functools import partial
from typing import TypeVar

from daemon.batch.errors import DaemonError
from scenario_tui.dashboard.app import Dashboard
from scenario_tui.dashboard.campaign_assessor import CampaignAssessor
from scenario_tui.dashboard.feed import Feed
from scenario_tui.dashboard.live_tracks import Tracks
from tests.parts import DEADLINE
from tests.people.idle import until_idle

T = TypeVar("T")


class InlineFeed(Feed):
    """Takes its picture in the caller's thread, so that tests know when it is taken."""

    def __init__(self, daemon):
        assessor = CampaignAssessor(every=0.0, elsewhere=0.0)
        super().__init__(daemon.open, clock=lambda: daemon.now, assessor=assessor)
        self.fake = daemon

    @property
    def on_news(self):
        """Nobody is told: the screen looks by itself."""
        return bool

    @on_news.setter
    def on_news(self, told):
        pass

    def start(self):
        """Start no thread."""

    def take_news(self):
        try:
            self.step(self.fake)
            if self.assess(self.fake):
                self.step(self.fake)
        except DaemonError as error:
            self._lose(error)
        self._lives.extend(self.fake.live)
        self.fake.live = ()
        for run, judge in list(self.fake.judges.items()):
            if run in self.fake.judged:
                judge(self.fake.judged[run])
        return super().take_news()


class CountedTasks:
    """Starts tasks of a dashboard and counts those under way, except ``scenario`` commands.

    A command ends when its test lets it.
    """

    def __init__(self, dashboard):
        self._start = dashboard.start_task
        self._commands = dashboard.run_command
        self.under_way = 0

    def __call__(self, work, then, otherwise):
        if isinstance(work, partial) and work.func is self._commands:
            self._start(work, then, otherwise)
        else:
            self.under_way += 1
            self._start(work, partial(self._pass_on, then), partial(self._pass_on, otherwise))

    def _pass_on(self, take, result):
        self.under_way -= 1
        take(result)


class InlineChildren:
    """Does in this process what the dashboard has a child do: that takes a second to start."""

    def run(self, function, *arguments, **options):
        return function(*arguments, **options)

    def close(self):
        """There is none."""


def make_dashboard(fake, **settings):
    settings.setdefault("child_processes", InlineChildren())
    dashboard = Dashboard(InlineFeed(fake), clock=lambda: fake.now, **settings)
    dashboard.start_task = CountedTasks(dashboard)
    # What was told once would have been heard of long ago on a busy machine.
    dashboard.tracks = Tracks(clock=lambda: fake.now)
    # On a busy machine what a test reads would be gone before.
    dashboard.NOTIFICATION_TIMEOUT = 600.0
    return dashboard


async def settle(pilot):
    """Let the dashboard take over what is new, twice: some screens ask because of what they see.

    Nothing that it has begun is under way then: no message, no worker, no task in a thread. A test
    has to wait by itself only for what it holds up itself, and for real daemons and files.
    """
    app = pilot.app
    assert isinstance(app, Dashboard)
    assert isinstance(app.start_task, CountedTasks)
    deadline, looks = time.monotonic() + DEADLINE, 0
    while looks < 2:
        assert time.monotonic() < deadline, "a background task is not done"
        await until_idle(app)
        app.update_state()
        await until_idle(app)
        looks += 1
        if app.start_task.under_way or app.recordings.busy:
            looks = 0
            await asyncio.sleep(0.002)


async def press(pilot, *keys):
    """Press keys; only moving the cursor needs no new picture in between."""
    for key, repeated in itertools.groupby(keys):
        together = list(repeated)
        for group in [together] if key in ("down", "j", "k") else [[k] for k in together]:
            await pilot.press(*group)
            await settle(pilot)


def screen_text(pilot):
    """Return the lines of the screen as a reader sees them."""
    lines = pilot.app.screen._compositor.render_strips()
    return [strip.text.rstrip() for strip in lines]
