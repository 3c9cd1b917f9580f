"""The dashboard in a browser, and how its server ends."""

import signal

import psutil
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from tests.chromium import CHROMIUM, chromium_page
from tests.people.dashboard.parts.test_web import server

RECORD = """
    window.received = "";
    window.WebSocket = class extends WebSocket {
        constructor(...words) {
            super(...words);
            const decoder = new TextDecoder();
            this.addEventListener("message", (event) => {
                if (typeof event.data !== "string") window.received += decoder.decode(event.data);
            });
        }
    };
"""
"""Keeps what the dashboard draws: the page itself shows it as a picture."""


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed")
def test_a_page_shows_a_dashboard_that_takes_keys_and_changes_nothing(tmp_path):
    options = ("--enable-unsafe-swiftshader",)
    with (
        server(tmp_path / "state") as served,
        chromium_page(served.address, tmp_path, *options, script=RECORD) as page,
    ):
        assert page.wait("received.includes('No daemon answers')")
        page.press("s")
        assert page.wait("received.includes('this dashboard changes nothing')")
        assert page.evaluate("document.fonts.check('16px \"Roboto Mono\"')")
        # Nothing was asked for elsewhere, nothing was missing; what the page logs (how long a ping
        # took, that the machine is slow) is a list.
        assert not [problem for problem in page.problems if isinstance(problem, dict)]
        page.press("q")  # closes the reason
        page.press("q")
        assert page.wait("document.querySelector('.closed').offsetHeight")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_dashboards_end_with_their_server(tmp_path, number):
    with server(tmp_path / "state", "--write") as running, running.page():
        dashboards = running.dashboards()
        assert "--read-only" not in dashboards[0].cmdline()
        running.process.send_signal(number)
        code = running.process.wait()
        assert code == (0 if number != signal.SIGKILL else -number)
        assert not psutil.wait_procs(dashboards, 100 if number == signal.SIGKILL else 0)[1]


def test_behind_a_proxy_pages_are_those_of_its_address(tmp_path):
    public = "https://lab.example/scenario/"
    with server(tmp_path / "state", "--public-url", public) as running:
        with connect(running.socket, origin="https://lab.example"):
            pass
        with pytest.raises(InvalidStatus, match="403"):
            connect(running.socket, origin=running.origin)
