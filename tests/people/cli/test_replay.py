"""``scenario replay``: frames for scripts, and what is said of wrong words."""

import pytest

from scenario_tui.cli import invoke
from tests.people.recorded import record_run


@pytest.fixture(scope="module")
def trace(tmp_path_factory):
    return str(record_run(tmp_path_factory.mktemp("traces") / "run.mcap"))


@pytest.fixture(autouse=True)
def state(tmp_path, monkeypatch):
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path / "state"))
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("LINES", "24")


def test_a_frame_is_plain_text_without_a_terminal(trace, capsys):
    assert invoke(["replay", trace, "--frame", "no-contact"]) == 0
    out = capsys.readouterr().out
    assert "\x1b" not in out
    lines = out.splitlines()
    assert len(lines) == 23
    assert lines[0].startswith("S2/pilot/0  6.0 s of 10.0 s")
    assert "✱" in out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--frame", "no-contat"), "no-contact"),
        (("--speed", "0"), "0.1"),
        ((), "needs a terminal"),
    ],
)
def test_wrong_words_are_explained(trace, capsys, arguments, words):
    assert invoke(["replay", trace, *arguments]) == 2
    assert words in capsys.readouterr().err


def test_a_run_nobody_knows_and_a_damaged_trace(tmp_path, capsys):
    assert invoke(["replay", "nobody.1", "--frame", "1"]) == 2
    assert "no campaign or run" in capsys.readouterr().err.replace("\n", " ")
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(b"not a trace")
    assert invoke(["replay", str(broken), "--frame", "1"]) == 2
    assert "is no trace (MCAP file)" in capsys.readouterr().err


def test_two_runs_without_a_terminal_are_compared_in_words(trace, tmp_path, capsys):
    slow = str(record_run(tmp_path / "slow.mcap", index=6, speed=0.4))
    assert invoke(["replay", trace, slow]) == 0
    lines = capsys.readouterr().out.splitlines()
    (row,) = (line for line in lines if line.startswith("slow "))
    assert row.split()[1:] == [
        "✓",
        "pass",
        "+0.1",
        "m/s",
        "✓",
        "pass",
        "+0.2",
        "m/s",
        "+0.1",
        "m/s",
    ]
    assert lines[lines.index("seed") + 1].split() == ["2024", "→", "2025"]


def test_a_frame_is_of_one_run(trace, capsys):
    assert invoke(["replay", trace, trace, "--frame", "1"]) == 2
    assert "--frame" in capsys.readouterr().err
