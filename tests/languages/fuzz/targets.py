"""What is mutated, and how the outcome is read: as a person's ``scenario check`` would, and on."""

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from daemon.campaign import examine, expand
from daemon.search.composition import search_case
from daemon.search.preparation import check_search
from grammars.floorplan import load_floorplan, parse_floorplan
from grammars.jsonld import load_floorplan_jsonld, scene_document, scenery_document
from grammars.model.map_files import pack_map, read_map
from grammars.scenery import load_scenery
from grammars.text import codec
from grammars.text.diagnostics import InputError, Severity
from grammars.text.ros_yaml import load_ros_yaml
from grammars.variation import load_variation, sample
from scenario_tui.library.checking import check_file
from scenario_tui.text.diagnostics import render_diagnostic
from tests.languages.plans import HERE

SEEDS = Path(__file__).with_name("seeds")
CORPUS = Path(__file__).with_name("corpus")
_UNREADABLE = re.compile(r"is not UTF-8 text|is larger than|and \d+ more")
"""Messages about a file as a whole."""
_STEERING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")


@dataclass(frozen=True)
class Target:
    """A language: the file that is mutated, the one that is read, what is done if it is sound."""

    name: str
    file: str
    read: Callable[[Path], None]


def prepare(folder):
    """Lay out the campaign whose files are mutated one at a time."""
    shutil.copytree(SEEDS, folder, dirs_exist_ok=True)
    shutil.copytree(HERE / "models" / "plan_2023", folder / "earlier", dirs_exist_ok=True)
    plan = load_floorplan(folder / "plan.fpm")
    layer = load_scenery(folder / "objects.scenery")
    (folder / "plan.jsonld").write_bytes(_json(scene_document(plan)))
    (folder / "objects.jsonld").write_bytes(_json(scenery_document(layer, plan)))
    return folder


def _json(document):
    return json.dumps(document, indent=1).encode()


def answer(target, folder, data):
    """Write a mutated file and read it; returns whether it was taken.

    Raises ``AssertionError`` for a refusal that does not help, and whatever is no refusal.
    """
    file = folder / target.file
    whole = file.read_bytes()
    file.write_bytes(data)
    try:
        target.read(folder)
    except InputError as refused:
        assert refused.findings
        for diagnostic in refused.findings:
            _check_diagnostic(diagnostic)
        return False
    finally:
        file.write_bytes(whole)
    return True


def _check_diagnostic(told):
    assert told.message
    for shown in (str(told), render_diagnostic(told).plain):
        assert not _STEERING.search(shown), ascii(shown)
    file = Path(told.where.file)
    assert len(str(told)) < 20_000
    if _UNREADABLE.search(told.message) or not file.is_file():
        return
    text = file.read_bytes().decode("utf-8-sig", "replace")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    assert 1 <= told.where.line <= len(lines), f"no such line: {told}"
    assert 0 <= told.where.column <= len(lines[told.where.line - 1]) + 1, f"no such column: {told}"


def _told(found):
    """Check every finding; errors refuse the file."""
    for diagnostic in found:
        _check_diagnostic(diagnostic)
    errors = [one for one in found if one.severity is Severity.ERROR]
    if errors:
        raise InputError(errors)


def _checked(*names):
    """Return what checks files one after the other, and expands those that are campaigns."""

    def read(folder):
        for name in names:
            if name in _CAMPAIGNS:
                campaign, found = examine(folder / name)
                _told(found)
                codec.to_json(expand(campaign))
                for task in campaign.searches:
                    _told(check_search(search_case(campaign, task)))
            else:
                _told(check_file(folder / name)[1])

    return read


_CAMPAIGNS = ("campaign.yaml", "varied.yaml")


def _earlier_plan(folder):
    load_floorplan_jsonld(folder / "earlier")


def _variants(folder):
    variation = load_variation(folder / "plan.variation")
    for method in ("random", "lhs", "halton"):
        for variant in sample(variation, 2, seed=7, tries=8, check=0.2, method=method):
            assert parse_floorplan(variant.text) == variant.plan
            assert all(-1e7 < value.number < 1e7 for value in variant.values)


def _map(folder):
    pack_map(read_map(folder / "room.yaml").grid)


def _parameters(folder):
    _told(load_ros_yaml(folder / "params.yaml")[1])
    _told(check_file(folder / "stack.yaml")[1])


TARGETS = (
    Target("floorplan", "plan.fpm", _checked("plan.fpm", "campaign.yaml")),
    Target("walls", "home.walls.yaml", _checked("home.walls.yaml")),
    Target("variation", "plan.variation", _checked("plan.variation", "varied.yaml")),
    Target("variants", "plan.variation", _variants),
    Target("varied-plan", "plan.fpm", _variants),
    Target("scenery", "everything.scenery", _checked("everything.scenery")),
    Target("objects", "objects.scenery", _checked("objects.scenery", "campaign.yaml")),
    Target("behaviours", "motions.scenery", _checked("motions.scenery", "campaign.yaml")),
    Target("oracles", "checks.oracles.yaml", _checked("checks.oracles.yaml", "campaign.yaml")),
    Target("campaign", "campaign.yaml", _checked("campaign.yaml")),
    Target("varied", "varied.yaml", _checked("varied.yaml")),
    Target("mission", "errand.mission.yaml", _checked("errand.mission.yaml", "campaign.yaml")),
    Target("robot", "courier.yaml", _checked("courier.yaml", "campaign.yaml")),
    Target("sut", "stack.yaml", _checked("stack.yaml")),
    Target("launch", "start.launch", _checked("stack.yaml")),
    Target("parameters", "params.yaml", _parameters),
    Target("map", "room.yaml", _map),
    Target("image", "room.pgm", _map),
    Target("plan-graph", "plan.jsonld", _checked("plan.jsonld")),
    Target("earlier-numbers", "earlier/coordinate.json", _earlier_plan),
    Target("earlier-plan", "earlier/floorplan.json", _earlier_plan),
    Target("object-graph", "objects.jsonld", _checked("objects.jsonld")),
)
