"""The dashboard starts a daemon on its machine when none answers, and says how it is stopped."""

import threading

import pytest

from daemon.batch.errors import LaunchFailed
from scenario_tui.cli import tui
from scenario_tui.dashboard.config import Config
from tests.people.fake import CAMPAIGN, FakeDaemon
from tests.people.idle import until_idle

STARTED = (
    "started a daemon on this machine at tcp/127.0.0.1:7447 (`scenario daemon --stop` ends it)"
)


async def test_a_daemon_is_started_when_none_answers_and_leaving_says_how_to_stop_it(dashboard):
    fake, begin = FakeDaemon(reachable=False), threading.Event()

    def launch():
        begin.wait()
        fake.reachable = True
        return STARTED

    dash = await dashboard(fake, settled=False, launch_daemon=launch)
    await until_idle(dash.app)
    assert dash.lines[0].strip() == "… connecting"  # before it is known that none answers
    dash.app.update_state()
    await until_idle(dash.app)
    assert "starting one on this machine" in dash.text
    assert dash.lines[0].strip() == "… starting a daemon"
    begin.set()
    await dash.settle()
    assert CAMPAIGN in dash.text
    assert STARTED in dash.notices
    assert dash.app.farewell().endswith("\nStop the daemon with: scenario daemon --stop")


async def test_a_daemon_that_does_not_come_up_is_told_with_its_last_words(dashboard):
    def launch():
        raise LaunchFailed("the daemon ended with code 70:\nno space left")

    dash = await dashboard(FakeDaemon(reachable=False), launch_daemon=launch)
    assert "no space left" in dash.notices
    assert "d starts one. In another terminal" in dash.text


async def test_a_key_starts_a_daemon_that_is_gone_and_does_nothing_beside_one_that_answers(
    dashboard,
):
    fake, launches = FakeDaemon(), []

    def launch():
        launches.append(fake.reachable)
        fake.reachable = True
        return ""

    dash = await dashboard(fake, launch_daemon=launch)
    assert not dash.notices
    assert "stop" not in dash.app.farewell()
    await dash.press("d")
    assert launches == [True]
    fake.reachable = False
    await dash.settle()
    assert "d starts a daemon on this machine" in dash.lines[1]
    await dash.press("d")
    assert launches == [True, False]
    assert "starts a daemon" not in dash.lines[1]


@pytest.mark.parametrize(
    ("arguments", "read_only", "started"),
    [
        ((), False, True),
        (("--connect", "tcp/127.0.0.1:9"), False, False),
        (("--read-only",), False, False),
        ((), True, False),
    ],
)
def test_none_is_started_behind_the_back_of_who_named_one_or_only_looks(
    scenario, tmp_path, monkeypatch, arguments, read_only, started
):
    launchers = []

    def run(*given):
        launchers.append(given[2])
        return 0, "left"

    monkeypatch.setattr(tui, "why_no_screen", lambda: "")
    monkeypatch.setattr("scenario_tui.dashboard.app.run_dashboard", run)
    monkeypatch.setattr(tui, "read_config", lambda: Config(read_only=read_only))
    said = scenario("tui", "--state", str(tmp_path), *arguments)
    assert said.code == 0, said.err
    assert [launcher is not None for launcher in launchers] == [started]


def test_where_nothing_can_be_drawn_it_is_said_what_to_do_instead(scenario):
    said = scenario("tui")
    assert said.code == 2
    assert "scenario status" in said.err
