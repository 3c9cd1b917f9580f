"""The dashboard in a browser: for its own pages alone, to look only, and gone with its server."""

import os
import re
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

from tests.parts import eventually, free_endpoint


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
