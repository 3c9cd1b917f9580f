"""A dashboard to drive in a test, without a thread: keys go in, its screen is read as text."""

import asyncio
import itertools
import threading
import time
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from functools import partial

from textual._context import active_app
from textual.app import App

from daemon.batch.errors import DaemonError
from scenario_tui.dashboard.app import Dashboard
from scenario_tui.dashboard.feed import Feed
from scenario_tui.dashboard.run_watch import Tracks
from scenario_tui.dashboard.state import CampaignAssessor
from tests.parts import DEADLINE
from tests.people.idle import until_idle


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

    @property
    def may_know_more(self):
        """Whether there may be more to know than when the last picture was taken."""
        state = self._state
        return self._requested.is_set() or not (state.connected and state.campaigns)

    def start(self):
        """Start no thread."""

    def take_news(self):
        try:
            self._wake.clear()
            self.step(self.fake)
            while self.assess(self.fake):
                self._wake.set()
            if self._wake.is_set():
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


@dataclass
class Commands:
    """Stands for the ``scenario`` commands the dashboard starts; they answer when ``done``."""

    answer: dict[str, object] = field(default_factory=dict)
    asked: list[tuple[str, ...]] = field(default_factory=list)
    done: threading.Event = field(default_factory=threading.Event)

    def __call__(self, arguments):
        self.asked.append(arguments)
        assert self.done.wait(DEADLINE)
        return self.answer


def make_dashboard(fake, **settings):
    settings.setdefault("child_processes", InlineChildren())
    dashboard = Dashboard(InlineFeed(fake), clock=lambda: fake.now, **settings)
    dashboard.start_task = CountedTasks(dashboard)
    # What was told once would have been heard of long ago on a busy machine.
    dashboard.tracks = Tracks(clock=lambda: fake.now)
    # On a busy machine what a test reads would be gone before.
    dashboard.NOTIFICATION_TIMEOUT = 600.0
    return dashboard


def is_reading():
    """Whether a recording is fetched or read."""
    return any(thread.name == "recording" for thread in threading.enumerate())


async def settle(pilot):
    """Let the dashboard take over what is new, and again if it asks because of what it sees.

    Nothing that it has begun is under way then: no message, no worker, no task in a thread. A test
    has to wait by itself only for what it holds up itself, and for real daemons and files.
    """
    app = pilot.app
    if not isinstance(app, Dashboard):
        await until_idle(app)
        return

    def in_threads():
        return app.start_task.under_way or is_reading()

    for _ in range(2):
        await until_idle(app, in_threads)
        app.update_state()
        await until_idle(app, in_threads)
        if not app.feed.may_know_more:
            return


async def press(pilot, *keys):
    """Press keys; only moving the cursor needs no new picture in between."""
    for key, repeated in itertools.groupby(keys):
        together = list(repeated)
        for group in [together] if key in ("down", "j", "k") else [[k] for k in together]:
            await pilot.press(*group)
            await settle(pilot)


async def eventually(condition, pilot=None):
    """Wait for something another thread or process does; let a ``pilot``'s app come to rest."""
    deadline = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < deadline, "it did not happen in time"
        await asyncio.sleep(0.01)
        if pilot is not None:
            await settle(pilot)


class Dash:
    """A running app; each of its methods returns when the app has nothing left to do."""

    def __init__(self, app, fake=None):
        self.app, self.fake = app, fake
        self.pilot, self._task, self._leave = None, None, asyncio.Event()
        self._seen = None

    async def begin(self, size, settled=True):
        """Run the app, in a task of its own: its test and the end of a fixture are two others."""
        begun = asyncio.Event()

        async def run():
            try:
                async with self.app.run_test(size=size) as self.pilot:
                    begun.set()
                    await self._leave.wait()
            finally:
                begun.set()

        self._task = asyncio.create_task(run())
        await begun.wait()
        if self.pilot is None:
            await self._task
        active_app.set(self.app)
        if settled:
            await self.settle()

    async def leave(self):
        """Leave the app, if it is not left yet; raise what went wrong in it."""
        self._leave.set()
        await self._task

    @property
    def screen(self):
        return self.app.screen

    @property
    def strips(self):
        """The lines of the screen with their styles; drawn once until its app can do something."""
        if self._seen is None or self._seen[0] is not self.screen:
            self._seen = self.screen, list(self.screen._compositor.render_strips())
            asyncio.get_running_loop().call_soon(self._forget)
        return self._seen[1]

    def _forget(self):
        self._seen = None

    @property
    def lines(self):
        """The lines of the screen as a reader sees them."""
        return [strip.text.rstrip() for strip in self.strips]

    @property
    def text(self):
        return "\n".join(self.lines)

    @property
    def notices(self):
        return "\n".join(notice.message for notice in self.app._notifications)

    def one(self, *which):
        """Return the only widget of a kind, or with an id, on the screen in front."""
        return self.screen.query_one(*which)

    async def settle(self):
        await settle(self.pilot)

    async def press(self, *keys):
        if isinstance(self.app, Dashboard):
            await press(self.pilot, *keys)
        else:
            await self.pilot.press(*keys)
            await until_idle(self.app)

    async def open(self, place, id):
        """Open a run or the runs of a campaign, and wait until its trace is read."""
        await self.pilot.pause(0)
        self.app.open(place, id)
        await self.settle()

    async def resize(self, columns, rows):
        await self.pilot.resize_terminal(columns, rows)
        await self.settle()

    async def until(self, condition):
        """Wait for something another thread does."""
        await eventually(condition, self.pilot)


@asynccontextmanager
async def opened_apps():
    """Give a function that opens an app; leave all that it opened in the end."""
    opened = []

    async def open_app(what, size=(80, 24), settled=True, **settings):
        dash = Dash(what) if isinstance(what, App) else Dash(make_dashboard(what, **settings), what)
        opened.append(dash)
        await dash.begin(size, settled)
        return dash

    try:
        yield open_app
    finally:
        for dash in opened:
            await dash.leave()
