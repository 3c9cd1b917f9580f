"""The pytest plug-in in sessions of its own: items, runs from cache, messages of failures."""

import shutil
import xml.etree.ElementTree as ET
from dataclasses import replace

import pytest

from daemon.batch.client import Client
from daemon.batch.launch import shared_daemon
from daemon.model.verdicts import RunState
from scenario_tui.library.pytest_plugin import CampaignRuns

pytest_plugins = ["pytester"]

# The session around these tests may have loaded it, too.
PLUGIN = ("-p", "scenario_tui_pytest", "-W", "ignore::pytest.PytestAssertRewriteWarning")
ORACLES = """\
no-contact: never(contact)
arrives: reached(mission, 0.3 m)
nearest: min(clearance)
"""
HOUSE = """\
campaign: house
seed: 1
repeats: 2
limit: 8 s
robot: courier
oracles: checks
map: {rule: touch}
matrix: {sut: [pilot]}
defaults: {floorplan: flat, objects: doors, mission: courier,
           oracles: [no-contact, arrives, nearest]}
scenarios:
  open: {behaviours: doors_open}
  moving: {behaviours: doors_moving}
"""
SHORT = "{scenario: open, oracle: arrives, verdict: fail, why: eight seconds are too short}"
FILE = "demo/house.campaign.yaml"


@pytest.fixture(scope="module")
def house(tmp_path_factory, campaigns):
    """A project with a campaign; its daemon stays, so that no session waits for a new one."""
    folder = tmp_path_factory.mktemp("house")
    for part in ("demo", "robots", "suts"):
        shutil.copytree(campaigns / part, folder / part)
    (folder / "demo" / "checks.oracles.yaml").write_text(ORACLES)
    with shared_daemon(folder / ".pytest_cache" / "d" / "scenario", trace_bytes=2**30) as endpoint:
        yield folder, endpoint


@pytest.fixture
def run(house, pytester, monkeypatch):
    """Run pytest in the project, whose campaign has more declarations below its scenarios."""
    folder, _ = house
    for name in ("SCENARIO_CONNECT", "SCENARIO_STATE", "PYTEST_XDIST_WORKER", "PYTEST_ADDOPTS"):
        monkeypatch.delenv(name, raising=False)
    # Sessions inside these tests forget what they imported, and NumPy cannot be loaded twice.
    monkeypatch.setattr("_pytest.pytester.SysModulesSnapshot.restore", lambda _: None)
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    monkeypatch.chdir(folder)

    def call(*arguments, more="", repeats="2", subprocess=False):
        text = HOUSE.replace("repeats: 2", f"repeats: {repeats}")
        (folder / FILE).write_text(text + more)
        execute = pytester.runpytest_subprocess if subprocess else pytester.runpytest_inprocess
        return execute(*PLUGIN, f"--rootdir={folder}", *arguments)

    return call


def newest(house):
    """The campaign that was submitted last, and its runs."""
    with Client.open(house[1]) as client:
        row = client.campaign_page(limit=1)[0]
        return row, client.all_runs(row.id)


def test_an_item_is_a_scenario_with_a_system_and_an_oracle(run, tmp_path):
    cache = tmp_path / "cache"
    result = run("--collect-only", "-q", "-o", f"cache_dir={cache}", "demo")
    assert result.outlines[:4] == [
        f"{FILE}::open::pilot::no-contact",
        f"{FILE}::open::pilot::arrives",
        f"{FILE}::moving::pilot::no-contact",
        f"{FILE}::moving::pilot::arrives",
    ]
    assert not (cache / "d").exists()


def test_a_failure_is_told_with_moment_picture_and_replay_command(run, house):
    result = run(FILE, more=f"expect: [{SHORT}]")
    result.assert_outcomes(passed=2, xfailed=1, failed=1)
    result.stdout.fnmatch_lines(
        [
            "*moving / pilot / arrives*",
            "✗ fail  arrives  ! expected pass",
            "  worst in repeat 0: −*kitchen, waypoint 1 of 4 is the first missed*",
            "picture: .pytest_cache/d/scenario/pictures/house-*.2.svg",
            "replay:  scenario replay .pytest_cache/d/scenario/traces/house-*/moving.pilot.0.mcap",
        ]
    )
    said = dict(line.split(":", 1) for line in result.outlines if line.startswith(("pic", "rep")))
    assert (house[0] / said["picture"].strip()).read_text().startswith("<?xml")
    assert (house[0] / said["replay"].split()[-1]).is_file()
    assert "Traceback" not in result.stdout.str()
    assert "pytest_plugin" not in result.stdout.str()


def test_only_selected_runs_are_executed_and_known_results_are_used_again(run, house):
    run("-k", "moving and no-contact", FILE).assert_outcomes(passed=1, deselected=3)
    _, first = newest(house)
    assert [row.scenario for row in first] == ["moving", "moving"]
    more = f"expect: [{SHORT}, {{scenario: moving, oracle: arrives, verdict: any, why: who knows}}]"
    run(FILE, more=more).assert_outcomes(passed=2, xfailed=2)
    row, runs = newest(house)
    assert row.total == 4
    assert row.cached >= 2  # all of them when other tests have run here
    assert {one.digest for one in first} <= {one.digest for one in runs}


def test_what_passes_against_expectation_fails(run):
    known = "{scenario: '*', oracle: no-contact, verdict: %s, why: the door is in the way}"
    fail = run("-k", "open and contact", FILE, more=f"expect: [{known % 'fail'}]")
    fail.assert_outcomes(failed=1, deselected=3)
    fail.stdout.fnmatch_lines(["[[]XPASS(strict)[]] the door is in the way"])
    mixed = run("-k", "open and contact", FILE, more=f"expect: [{known % 'mixed'}]")
    mixed.assert_outcomes(failed=1, deselected=3)
    either = run("-k", "open and contact", FILE, more=f"expect: [{known % 'any'}]")
    either.assert_outcomes(xpassed=1, deselected=3)


def test_a_comparison_is_an_item(run):
    result = run(f"{FILE}::compare", more="compare: {nearer: nearest(moving vs open) >= 1 m}\n")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        ["pilot nearer  ✗ fail +*n=2 !", "*should be nearest(moving vs open) >= 1 m"]
    )


def test_repeats_are_judged_together_by_the_policy(run):
    few = run("-k", "open and contact", FILE, repeats="{n: 2, pass: rate >= 80 %}")
    few.assert_outcomes(failed=1, deselected=3)
    few.stdout.fnmatch_lines(["? inconclusive  no-contact*", "  2 of 2 shows at least*more runs*"])
    policy = "{n: 2, pass: rate >= 30 %, until: decided, at-most: 4}"
    run("-k", "open and contact", FILE, repeats=policy).assert_outcomes(passed=1, deselected=3)


def test_findings_are_told_without_a_traceback(run):
    result = run(FILE, more="  worse: {floorplan: flad}\n  other: {mision: courier}\n")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(
        ["*ERROR collecting*", f'{FILE}:15:11: unknown key "mision"', "*mission*"]
    )
    assert "Traceback" not in result.stdout.str()
    assert "pytest_plugin.py" not in result.stdout.str()


def test_a_lost_run_is_an_error_unless_the_verdict_stands_without_it(run, monkeypatch):
    wait = CampaignRuns.rows

    def lose_one(runs, cells):
        first, *rest = wait(runs, cells)
        return replace(first, state=RunState.LOST, outcome=None, result=None), *rest

    monkeypatch.setattr(CampaignRuns, "rows", lose_one)
    result = run("-k", "moving", FILE)
    result.assert_outcomes(errors=1, failed=1, deselected=2)
    result.stdout.fnmatch_lines(["moving/pilot/0 was lost*"])


def test_junit_has_margin_seed_digest_and_trace(run, tmp_path):
    run("-k", "moving and arrives", f"--junit-xml={tmp_path / 'junit.xml'}", FILE)
    case = ET.parse(tmp_path / "junit.xml").getroot().find(".//testcase")
    assert case is not None
    assert case.get("name") == "arrives"
    assert case.get("classname", "").endswith("house.campaign.yaml.moving.pilot")
    properties = {one.get("name"): one.get("value", "") for one in case.iter("property")}
    assert properties.keys() == {"margin", "unit", "seed", "digest", "trace"}
    assert float(properties["margin"]) < 0.0


def test_a_project_names_its_campaigns(run, house):
    folder, _ = house
    (folder / "demo" / "campaign.yaml").write_text(HOUSE)
    settings = folder / "pyproject.toml"
    try:
        assert "demo/campaign.yaml" not in run("--collect-only", "-q", "demo").stdout.str()
        alone = run("--collect-only", "-q", "demo/campaign.yaml")
        assert "demo/campaign.yaml::open::pilot::arrives" in alone.outlines
        settings.write_text('[tool.scenario]\ncampaigns = ["*/campaign.yaml"]\n')
        assert "demo/campaign.yaml::open" in run("--collect-only", "-q", "demo").stdout.str()
        settings.write_text('[tool.scenario]\ncampaigns = "demo"\n')
        run("demo").stdout.fnmatch_lines(["*campaigns of [[]tool.scenario[]] is a list of paths*"])
    finally:
        settings.unlink()


def test_a_named_daemon_executes_the_runs(run, house):
    result = run("-k", "moving and arrives", "--scenario-connect", house[1], FILE)
    result.assert_outcomes(failed=1, deselected=3)
    result.stdout.fnmatch_lines([f"replay:  scenario replay house-*.0 --connect {house[1]}"])
    wrong = run("-k", "moving and arrives", "--scenario-connect", "bench", FILE)
    wrong.assert_outcomes(errors=1, deselected=3)
    wrong.stdout.fnmatch_lines(["--scenario-connect: 'bench' is not an endpoint"])


def test_a_test_asks_for_the_runs_of_a_scenario(run, house, tmp_path):
    test = tmp_path / "test_house.py"
    test.write_text(
        f"""
def test_passes(scenario):
    cell = scenario("{FILE}", "open", sut="pilot")
    assert cell["no-contact"].outcome == "pass"
    assert len(cell.runs) == 2


def test_fails(scenario):
    assert scenario("{FILE}", "open").outcome == "pass"


def test_is_wrong(scenario):
    scenario("{FILE}", "opne")
"""
    )
    result = run(str(test))
    result.assert_outcomes(passed=1, failed=2)
    result.stdout.fnmatch_lines(
        [
            "*- open / pilot -*",
            "✗ fail  arrives  −*",
            "picture: .pytest_cache/d/scenario/pictures/house-*.0.svg",
            "replay:  scenario replay .pytest_cache/d/scenario/traces/house-*/open.pilot.0.mcap",
            '*house.campaign.yaml: no scenario "opne"',
            '    did you mean "open"?',
        ]
    )
    assert "✓ pass  no-contact" not in result.stdout.str()
    assert "pytest_plugin" not in result.stdout.str()
