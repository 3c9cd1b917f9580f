"""The dashboard in a browser: for its own pages alone, to look only, and gone with its server."""

import os
import re
import signal
import subprocess
import sys
import urllib.request
from contextlib import contextmanager
from pathlib import Path
from urllib.error import HTTPError

import psutil
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from tests.chromium import CHROMIUM, chromium_page
from tests.parts import eventually, free_endpoint

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


class Server:
    """A server of dashboards, and the port it has."""

    def __init__(self, process, port, address):
        self.process = process
        self.address = address
        self.origin = f"http://127.0.0.1:{port}"
        self.socket = f"ws://127.0.0.1:{port}/ws?width=80&height=24"
        self.cookie = {"Cookie": f"scenario-{port}={address.partition('?key=')[2]}"}

    @contextmanager
    def page(self):
        """Open a websocket as its page does; its dashboard has begun to draw then."""
        cookie = self.cookie
        with connect(self.socket, origin=self.origin, additional_headers=cookie) as socket:
            assert socket.recv(timeout=100)
            yield

    def dashboards(self):
        return psutil.Process(self.process.pid).children()


@contextmanager
def server(folder, *options):
    port = free_endpoint().rpartition(":")[2]
    command = [sys.executable, "-c", "from scenario_tui.cli import main; main()"]
    words = ["tui", "--web", "--port", port, "--state", str(folder), *options]
    environment = {**os.environ, "XDG_CONFIG_HOME": str(folder.parent), "TERM": "dumb"}
    environment["SCENARIO_CONNECT"] = "tcp/127.0.0.1:9"  # none is started, which would stay
    process = subprocess.Popen(
        [*command, *words], stderr=subprocess.PIPE, text=True, env=environment, cwd=folder.parent
    )
    try:
        line = process.stderr.readline()
        assert f"http://127.0.0.1:{port}/" in line
        yield Server(process, port, re.search(r"https?://\S+?(?=[ ,;])", line)[0])
    finally:
        process.kill()
        process.wait()
        process.stderr.close()


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A server that may only show; its state directory has a name that a shell would obey."""
    with server(tmp_path_factory.mktemp("web") / "it's $(touch obeyed); touch obeyed") as running:
        yield running


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed")
def test_a_page_shows_a_dashboard_that_takes_keys_and_changes_nothing(served, tmp_path):
    options = ("--enable-unsafe-swiftshader",)
    with chromium_page(served.address, tmp_path, *options, script=RECORD) as page:
        assert page.wait("received.includes('No daemon answers')")
        page.press("s")
        assert page.wait("received.includes('nothing is changed from this dashboard')")
        assert page.evaluate("document.fonts.check('16px \"Roboto Mono\"')")
        # Nothing was asked for elsewhere, nothing was missing; what the page logs (how long a ping
        # took, that the machine is slow) is a list.
        assert not [problem for problem in page.problems if isinstance(problem, dict)]
        page.press("q")  # closes the reason
        page.press("q")
        assert page.wait("document.querySelector('.closed').offsetHeight")


def test_foreign_pages_are_refused(served):
    cookie = served.cookie
    for origin in ("http://evil.example", "null", None, served.origin.replace("http", "https")):
        with pytest.raises(InvalidStatus, match="403"):
            connect(served.socket, origin=origin, additional_headers=cookie)
    # The owner of a name has it mean 127.0.0.1, so that pages here become his own.
    for path in ("/", "/ws"):
        assert "the dashboard is at" in refusal(served, path, {"Host": "evil.example", **cookie})


def test_other_accounts_of_the_machine_do_not_know_the_address(served):
    for path in ("/", "/?key=guessed"):
        assert "open the address" in refusal(served, path, {})
    with pytest.raises(InvalidStatus, match="403"):
        connect(served.socket, origin=served.origin)


def refusal(served, path, headers):
    """Ask for a path that is refused; return the words."""
    request = urllib.request.Request(served.origin + path, headers=headers)
    with pytest.raises(HTTPError, match="403") as refused:
        urllib.request.urlopen(request)
    return refused.value.read().decode()


def test_dashboards_are_started_without_a_shell_that_reads_names(served):
    eventually(lambda: not served.dashboards())  # those of pages that were left before
    with served.page():
        (dashboard,) = served.dashboards()
        words = dashboard.cmdline()
        assert "it's $(touch obeyed); touch obeyed" in words[words.index("--state") + 1]
        assert "--read-only" in words
        folder = Path(dashboard.cwd())
    eventually(lambda: not served.dashboards())
    assert not (folder / "obeyed").exists()


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
