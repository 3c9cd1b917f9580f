"""The guide for pytest, followed as it stands."""

import shlex

from daemon.batch.launch import shared_daemon
from scenario_tui.cli import invoke
from tests.docs import tutorials
from tests.docs.markdown import DOCS
from tests.people.library.parts.test_pytest_plugin import FILE, PLUGIN, SHORT, house, run

pytest_plugins = ["pytester"]
__all__ = ["house", "run"]


def test_the_guide_does_what_it_says(pytester, monkeypatch, capfd):
    monkeypatch.setattr("_pytest.pytester.SysModulesSnapshot.restore", lambda _: None)
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    monkeypatch.delenv("SCENARIO_CONNECT", raising=False)

    def run(command):
        program, *arguments = shlex.split(command)
        if program == "pytest":
            return pytester.runpytest(*PLUGIN, *arguments).stdout.str()
        assert program == "scenario"
        invoke(arguments)
        said = capfd.readouterr()
        return said.out + said.err

    # One daemon serves all sessions.
    with shared_daemon(pytester.path / ".pytest_cache" / "d" / "scenario", trace_bytes=2**30):
        assert list(tutorials.follow(DOCS / "pytest.md", pytester.path, run)) == []


def test_processes_of_xdist_share_one_daemon(run, house):
    options = ("-p", "xdist.plugin", "-n2")
    result = run(*options, FILE, more=f"expect: [{SHORT}]", subprocess=True)
    result.assert_outcomes(passed=2, xfailed=1, failed=1)
    log = house[0] / ".pytest_cache" / "d" / "scenario" / "daemon.log"
    assert log.read_text().count('"started"') == 1


def test_without_a_cache_runs_are_kept_with_temporary_files(run):
    result = run("-p", "no:cacheprovider", "-k", "moving and arrives", FILE)
    result.assert_outcomes(failed=1, deselected=3)
    result.stdout.fnmatch_lines(["replay:  scenario replay *scenario/traces/house-*.mcap"])
