"""What tests of apps wait for: all that an app does about a key, whoever does it and when."""

import threading
from functools import partial

import pytest
from textual.app import App
from textual.widgets import Static


class Chain(App[None]):
    """Answers a key by way of ``kind``; what comes of it has to be laid out to be seen."""

    def __init__(self, kind):
        super().__init__()
        self.kind = kind
        self.waits = threading.Event()

    def compose(self):
        yield Static("", id="answer")

    def on_key(self):
        answered = partial(self.query_one(Static).update, "answered\nin two lines")
        match self.kind:
            case "message":
                self.call_later(self.call_next, self.call_later, answered)
            case "refresh":
                self.call_after_refresh(self.screen.call_after_refresh, answered)
            case "timer":
                self.set_timer(0.1, answered)
            case "thread":
                self.run_worker(partial(self._work, answered), thread=True)

    def _work(self, answered):
        # Longer than textual waits by itself while a process uses no processor time.
        self.waits.wait(0.1)
        self.call_from_thread(answered)


@pytest.mark.parametrize("kind", ["message", "refresh", "timer", "thread"])
async def test_a_key_is_waited_for_until_its_answer_is_on_the_screen(kind):
    app = Chain(kind)
    async with app.run_test(size=(20, 5)) as pilot:
        await pilot.press("x")
        lines = [strip.text.rstrip() for strip in app.screen._compositor.render_strips()]
        assert lines[:2] == ["answered", "in two lines"]
