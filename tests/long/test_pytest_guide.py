"""The guide for pytest, followed as it stands."""

from daemon.batch.launch import shared_daemon
from scenario_tui.cli import invoke
from tests.docs import tutorials
from tests.docs.markdown import DOCS
from tests.people.library.parts.test_pytest_plugin import PLUGIN

pytest_plugins = ["pytester"]


def test_the_guide_does_what_it_says(pytester, monkeypatch, capfd):
    monkeypatch.setattr("_pytest.pytester.SysModulesSnapshot.restore", lambda _: None)
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    monkeypatch.delenv("SCENARIO_CONNECT", raising=False)

    def run(command):
        program, *arguments = tutorials.words_of(command)
        if program == "pytest":
            return pytester.runpytest(*PLUGIN, *arguments).stdout.str()
        assert program == "scenario"
        invoke(arguments)
        said = capfd.readouterr()
        return said.out + said.err

    # One daemon serves all sessions.
    with shared_daemon(pytester.path / ".pytest_cache" / "d" / "scenario", trace_bytes=2**30):
        assert list(tutorials.follow(DOCS / "pytest.md", pytester.path, run)) == []
