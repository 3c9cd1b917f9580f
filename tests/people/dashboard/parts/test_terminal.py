"""The dashboard of a real daemon in a real terminal: typed at, resized, left alone, suspended."""

import os
import shlex
import signal
import sys

import pytest

from tests.make import make_spec, submission_of
from tests.parts import daemon_at, eventually, finished
from tests.people.poison import WORD, assert_harmless
from tests.people.terminal.pseudo_terminal import (
    ALTERNATE,
    MOUSE,
    PASTE,
    scenario,
    terminal,
)

OUTCOMES = {"S1": "pass", "S2": "fail", "S3": "inconclusive"}


@pytest.fixture(scope="module")
def daemon(tmp_path_factory):
    """A daemon with a small campaign that is over."""
    with daemon_at(tmp_path_factory.mktemp("terminal") / "state", slots=1) as part:
        specs = (make_spec(scenario=name, outcome=outcome) for name, outcome in OUTCOMES.items())
        with part.client() as client:
            client.submit(submission_of("corridor-1", *specs))
            eventually(lambda: finished(client, len(OUTCOMES)))
        yield part


def dashboard(daemon):
    return scenario("tui", "--connect", daemon.endpoint)


def restored(shown):
    """Whether the terminal is as it was found."""
    modes = (ALTERNATE, PASTE, *MOUSE)
    return not any(shown.mode(mode) for mode in modes) and not shown.screen.cursor.hidden


def test_it_is_typed_at_resized_suspended_and_left_while_the_daemon_goes_and_comes(daemon):
    with terminal(dashboard(daemon), environ={"COLORTERM": "truecolor"}) as shown:
        shown.until("corridor-1")
        shown.until("✗1 fail")
        shown.until(lambda: "12151a" in {one.bg for one in shown.screen.buffer[10].values()})
        assert shown.mode(ALTERNATE)
        shown.type("/zz")
        shown.until(lambda: "corridor-1" not in shown.text)
        shown.type("\x1b")
        shown.until("corridor-1")
        shown.type("m")
        shown.until("S3")

        for columns, rows in ((120, 40), (40, 10), (80, 24)):
            shown.resize(columns, rows)
            shown.until(lambda: "? Help" in shown.lines[-1] and shown.lines[0].startswith(" ✓"))

        daemon.kill()
        shown.until("no daemon answers, data is")
        assert "S3" in shown.text
        daemon.restart()
        shown.until(lambda: shown.lines[0].startswith(" ✓"))

        shown.type("\x1a")
        eventually(lambda: (shown.read(0.05), shown.stopped())[1])
        shown.until(lambda: restored(shown))
        shown.clear()
        os.kill(shown.pid, signal.SIGCONT)
        shown.until("corridor-1")
        assert shown.mode(ALTERNATE)
        shown.type("\x0c")
        shown.until("corridor-1")

        shown.type("q")
        assert shown.wait() == 0, bytes(shown.raw[-2000:])
        assert "Left the dashboard" in shown.text
        assert restored(shown)
        # The terminal was asked nothing.
        assert b"\x1b[6n" not in shown.raw
        assert b"\x1b]11;?" not in shown.raw
    with daemon.client() as client:
        assert client.overview().done == len(OUTCOMES)


def test_sixteen_colours_and_ascii_are_enough(daemon):
    plain = {"TERM": "linux", "LANG": "C"}
    with terminal(dashboard(daemon), environ=plain) as shown:
        shown.until("corridor-1")
        shown.until("x1 fail")
        shown.type("m")
        shown.until("+ pass")

        def is_reverse(scenario):
            rows = [y for y, line in enumerate(shown.lines) if line.startswith(f" {scenario} ")]
            return any(one.reverse for y in rows[:1] for one in shown.screen.buffer[y].values())

        shown.until(lambda: is_reverse("S1"))
        drawn = bytes(shown.raw)
        assert drawn.isascii()
        assert b"38;" not in drawn
        assert b"48;" not in drawn
        assert not is_reverse("S2")


def test_keys_typed_while_it_loads_are_not_lost(daemon):
    with terminal(dashboard(daemon)) as shown:
        shown.until("connecting")
        shown.type("q")
        assert shown.wait() == 0
        assert "Left the dashboard" in shown.text
        assert restored(shown)


def test_it_leaves_while_a_thread_is_still_told_something_by_the_daemon(daemon):
    asking = (
        "from scenario_tui.cli import main\n"
        "from scenario_tui.dashboard import feed\n"
        "feed.Feed.close = lambda _: None\n"  # as when the daemon hangs
        "feed.Feed._breathe = lambda *_: None\n"
        "feed.REFRESH = feed._BREATH\n"
        "main()\n"
    )
    command = [sys.executable, "-c", asking, "tui", "--connect", daemon.endpoint]
    with terminal(command) as shown:
        shown.until("corridor-1")
        shown.type("q")
        assert shown.wait() == 0, bytes(shown.raw[-2000:])


@pytest.mark.parametrize(
    "late", ["scenario_tui.dashboard.app.Dashboard.__init__", "textual.app.App.run"]
)
def test_interrupted_before_it_is_drawn_it_gives_the_terminal_back(daemon, late):
    module, _, attribute = late.rpartition(".")[0].rpartition(".")
    interrupted = (
        "import importlib\n"
        f"kind = getattr(importlib.import_module({module!r}), {attribute!r})\n"
        "def interrupt(*_, **__):\n"
        "    raise KeyboardInterrupt\n"
        f"setattr(kind, {late.rpartition('.')[2]!r}, interrupt)\n"
        "from scenario_tui.cli import main\n"
        "main()\n"
    )
    command = [sys.executable, "-c", interrupted, "tui", "--connect", daemon.endpoint]
    with terminal(command) as shown:
        assert shown.wait() == 130
        assert restored(shown)


def test_a_dashboard_leaves_with_its_terminal_also_where_hang_ups_are_ignored(daemon):
    start = ["/bin/sh", "-c", f"trap '' HUP; exec {shlex.join(dashboard(daemon))}"]
    with terminal(start) as shown:
        shown.until("corridor-1")
        assert shown.hang_up() == -signal.SIGHUP


POISONED = """
import sys
from scenario_tui.cli import main
from scenario_tui.source import DaemonTarget
from tests.people.poison import PoisonedDaemon
fake = PoisonedDaemon(trouble="no space left")
DaemonTarget.open = lambda self: fake.open()
main(["tui", "--connect", "tcp/127.0.0.1:9"])
"""


def test_what_the_dashboard_sends_a_real_terminal_is_its_own():
    with terminal([sys.executable, "-c", POISONED], columns=120, rows=40) as shown:
        shown.until("nightly-00ff00f")
        shown.type("q")
        assert shown.wait() == 0
        assert WORD.encode() in shown.raw
        # Cleared once, by us, before there is anything to see.
        assert_harmless(bytes(shown.raw).replace(b"\x1b[2J\x1b[1;2H", b""))
