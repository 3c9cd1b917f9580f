"""Systems under test that plug in, tried in a child: whatever they do there is told in words."""

import os
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from daemon.model.attachments import SutMissing
from daemon.stacks.findings import ParameterError, ParameterFinding
from daemon.stacks.probe import check_plugged
from daemon.stacks.registry import check_parameters, make_sut
from tests.plugins import MODULE, install_plugins, place_of

PATIENCE = 60.0


@pytest.fixture(autouse=True)
def plugged(tmp_path, monkeypatch):
    install_plugins(tmp_path, monkeypatch)
    yield
    sys.modules.pop(MODULE, None)


def test_a_sound_stack_has_nothing_said_about_it_and_is_not_loaded_here():
    found = check_parameters("plain", {})
    assert (found.problems, found.without_effect) == ((), ())
    assert MODULE not in sys.modules


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("factory-leaves", "cannot be made: SystemExit: 2"),
        ("factory-leaves-at-once", "ended its process with code 5 while it was made"),
        ("factory-crashes", rf"crashed its process by SIGSEGV \(.*{MODULE}.py:\d+\)"),
        ("factory-refuses", '^"speed" must be positive$'),
        ("factory-reads-with-a-library", "^speed must be a valid number"),
        ("factory-has-no-words", "ValueError without a word"),
    ],
)
def test_what_a_factory_does_is_a_finding(kind, words):
    with pytest.raises(ValueError, match=words):
        check_parameters(kind, {})


@pytest.mark.parametrize("kind", ["factory-hangs", "import-hangs"])
def test_what_hangs_is_a_finding_and_says_where(kind):
    with pytest.raises(ValueError, match=r"was not made within 3 s \(.*\.py:\d+\)") as caught:
        check_plugged(partial(make_sut, kind), "theirs", {}, patience=3.0)
    assert "what takes longer belongs into start()" in str(caught.value)
    if kind == "factory-hangs":
        line = int(place_of("its factory hangs").rpartition(":")[2])
        assert any(f"{MODULE}.py:{number})" in str(caught.value) for number in (line - 1, line))


def test_what_a_factory_prints_is_a_finding(capfd):
    (problem,) = check_parameters("factory-prints", {}).problems
    assert 'prints while it is made: "loading weights" and 1 more' in problem.message
    assert "events of a Decision" in problem.hint
    assert capfd.readouterr() == ("", "")


def test_parameters_and_kinds_keep_their_own_errors():
    wrong = ParameterFinding(("speed", 0), "is negative", "write a positive one")

    def refuse(_):
        raise ParameterError([wrong])

    def miss(_):
        raise SutMissing("not installed here")

    with pytest.raises(ParameterError) as caught:
        check_plugged(refuse, "theirs", {}, patience=PATIENCE)
    assert caught.value.problems == (wrong,)
    with pytest.raises(SutMissing, match="not installed here"):
        check_plugged(miss, "theirs", {}, patience=PATIENCE)


def test_an_answer_does_not_wait_for_what_a_factory_has_started(tmp_path):
    started = tmp_path / "started"

    def start(_):
        if os.fork() == 0:
            started.write_text(str(os.getpid()))
            while True:
                os.read(os.pipe()[0], 1)
        while not started.exists() or not started.read_text():
            pass

    assert check_plugged(start, "theirs", {}, patience=PATIENCE).problems == ()
    # What is ended is a zombie until somebody takes notice; a living one has a command line.
    command = Path("/proc") / started.read_text() / "cmdline"
    deadline = time.monotonic() + PATIENCE
    while command.exists() and command.read_bytes():
        assert time.monotonic() < deadline
        time.sleep(0.01)
