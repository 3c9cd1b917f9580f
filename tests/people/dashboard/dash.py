"""An app to drive in a test: keys go in, its screen is read as text."""

import asyncio
from contextlib import asynccontextmanager

from textual._context import active_app
from textual.app import App

from tests.people.dashboard.driven import until
from tests.people.dashboard.inline import make_dashboard, press, screen_text, settle
from tests.people.idle import until_idle


class Dash:
    """A running app; each of its methods returns when the app has nothing left to do."""

    def __init__(self, app, fake=None):
        self.app, self.fake = app, fake
        self.pilot, self._task, self._leave = None, None, asyncio.Event()

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
    def lines(self):
        """The lines of the screen as a reader sees them."""
        return screen_text(self.pilot)

    @property
    def text(self):
        return "\n".join(self.lines)

    @property
    def words(self):
        """The text of the screen, with a blank for every line break and gap."""
        return " ".join(self.text.split())

    @property
    def notices(self):
        return "\n".join(notice.message for notice in self.app._notifications)

    def one(self, *which):
        """Return the only widget of a kind, or with an id, on the screen in front."""
        return self.screen.query_one(*which)

    async def settle(self):
        if hasattr(self.app, "update_state"):
            await settle(self.pilot)
        else:
            await until_idle(self.app)

    async def press(self, *keys):
        if hasattr(self.app, "update_state"):
            await press(self.pilot, *keys)
        else:
            await self.pilot.press(*keys)
            await until_idle(self.app)

    async def open(self, place, id):
        """Open a run or the runs of a campaign, and wait until its trace is read."""
        await self.pilot.pause(0)
        self.app.open(place, id)
        await self.read()

    async def read(self):
        """Wait until all is read that the screen shows."""
        await self.settle()
        await self.app.workers.wait_for_complete()
        await self.settle()

    async def resize(self, columns, rows):
        await self.pilot.resize_terminal(columns, rows)
        await self.settle()

    async def until(self, condition):
        """Wait for something another thread does."""
        await until(self.pilot, condition)


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
