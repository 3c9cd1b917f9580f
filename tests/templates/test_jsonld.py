"""Layers as files others can read, and read back as they were."""

from grammars.floorplan import load_floorplan
from grammars.jsonld import load_floorplan_jsonld, load_scenery_jsonld
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene
from templates.jsonld import write_jsonld


def test_a_scenario_written_as_jsonld_is_the_same_scene(campaigns, tmp_path):
    plan = load_floorplan(campaigns / "demo" / "flat.fpm")
    layers = [
        load_scenery(campaigns / "demo" / f"{name}.scenery") for name in ("doors", "doors_open")
    ]
    written = write_jsonld(plan, tmp_path, layers)
    assert [path.name for path in written] == [
        *("skeleton.json", "shape.json", "polyhedron.json"),
        *("spatial_relations.json", "coordinate.json", "floorplan.json"),
        *("flat.jsonld", "objects.json", "doors.scenery.jsonld", "doors_open.scenery.jsonld"),
    ]
    back = [load_scenery_jsonld(path) for path in written[-2:]]
    scene = compile_scene(load_floorplan_jsonld(written[6]), back)
    assert scene.digest == compile_scene(plan, layers).digest


def test_same_layers_same_bytes(campaigns, tmp_path):
    plan = load_floorplan(campaigns / "demo" / "flat.fpm")
    layers = [load_scenery(campaigns / "demo" / "doors.scenery")]
    first, second = (write_jsonld(plan, tmp_path / name, layers) for name in ("a", "b"))
    for one, other in zip(first, second, strict=True):
        assert one.read_bytes() == other.read_bytes()
