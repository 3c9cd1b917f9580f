"""``run``, ``check`` and ``export`` with nothing faked: no daemon stays, none is needed."""

import re
import signal
import subprocess
import time
from pathlib import Path

import pytest

from scenario_tui.cli.exit_codes import exit_code
from tests.people.cli.outputs import declared
from tests.people.cli.real import COMMAND, call, call_here, endless, short_demo


@pytest.fixture(scope="module")
def place(tmp_path_factory, campaigns):
    """A folder with the demo campaign cut down to two short runs."""
    return short_demo(tmp_path_factory.mktemp("real"), campaigns)


def test_run_leaves_nothing_behind_but_traces(place):
    file = str(place / "campaigns" / "demo" / "campaign.yaml")
    done = call("run", file, "--json", state=place / "untouched", cwd=place)
    body = declared(done.stdout)
    assert body["schema"] == "scenario/results/1"
    assert [row["state"] for row in body["runs"]] == ["done", "done"]
    assert done.returncode == exit_code(row["outcome"] for row in body["runs"])
    folder = place / "scenario-results" / body["campaign"]["id"]
    traces = sorted(path.name for path in folder.glob("*.mcap"))
    assert {path.name for path in folder.iterdir()} == {*traces, "campaign.json"}
    assert traces == ["open-house.pilot.0.mcap", "open-house.pilot.1.mcap"]
    assert {row["trace"] for row in body["runs"]} == {str(folder / name) for name in traces}
    assert not (place / "untouched").exists()
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_run_told_to_end_leaves_no_workshop_behind(place, tmp_path, number):
    file = endless(place / "campaigns" / "demo" / "campaign.yaml")
    process = subprocess.Popen(
        [*COMMAND, "run", str(file), "-o", str(tmp_path)],
        stderr=subprocess.PIPE,
        text=True,
        cwd=place,
        # Ctrl-C is ignored in what a script starts in the background, these tests perhaps.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    # Once its worker is there it watches: an interrupt while it loads libraries may be lost in one.
    while not list(tmp_path.glob(".scenario-*/spool/[!.]*")):
        assert process.poll() is None
        time.sleep(0.05)
    process.send_signal(number)
    _, said = process.communicate()
    assert process.returncode == 130, said
    assert "interrupted" in said
    assert not list(tmp_path.glob(".scenario-*"))


def test_check_reports_every_layer(place):
    broken = place / "broken.mission.yaml"
    broken.write_text("mission: x\nstart: {x: 1 parsec}\n")
    demo = str(place / "campaigns" / "demo" / "campaign.yaml")
    done = call_here("check", demo, str(broken), "--json", state=place / "none", cwd=place)
    assert done.returncode == 2
    body = declared(done.stdout)
    assert body["schema"] == "scenario/check/1"
    assert not [d for d in body["files"][demo] if d["severity"] == "error"]
    assert body["files"][str(broken)]
    said = call_here("check", str(broken), "nothing.fpm", state=place / "none", cwd=place)
    assert said.returncode == 2
    assert f"{broken}:" in said.stderr
    assert re.search("nothing.fpm: error: .*no such file", said.stderr, re.IGNORECASE)


def test_export_writes_what_was_asked_for(place):
    plan = str(place / "campaigns" / "demo" / "flat.fpm")
    out = place / "out-map"
    done = call_here("export", plan, "map", "-o", str(out), state=place / "none", cwd=place)
    assert done.returncode == 0, done.stderr
    written = {Path(line) for line in done.stdout.splitlines()}
    assert written == set(out.iterdir())
    assert {path.name for path in written} == {"flat.pgm", "flat.yaml"}
