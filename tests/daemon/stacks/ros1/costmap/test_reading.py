"""Files of people, flat and layered."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from daemon.stacks.findings import FindingCollector, ParameterError
from daemon.stacks.ros1.costmap import CostmapParameters, ObservationSource, read_costmap

PLACE = ("move_base", "global_costmap")
SCAN = {
    "sensor_frame": "base_laser", "data_type": "LaserScan", "topic": "front", "marking": True,
    "clearing": True,
}  # fmt: skip
LAYERS = [
    {"name": "walls", "type": "costmap_2d::StaticLayer"},
    {"name": "obstacles", "type": "costmap_2d::ObstacleLayer"},
    {"name": "around", "type": "costmap_2d::InflationLayer"},
]


def read(given: dict[str, Any]) -> tuple[CostmapParameters, list[str]]:
    report = FindingCollector()
    parameters = read_costmap(given, PLACE, report)
    findings = report.findings()
    return parameters, [str(problem) for problem in findings.problems]


def refusal(given: dict[str, Any]) -> str:
    with pytest.raises(ParameterError) as error:
        read(given)
    return str(error.value)


def test_a_flat_file_is_read() -> None:
    parameters, problems = read(
        {
            "global_frame": "map", "robot_base_frame": "base_link", "update_frequency": 10,
            "static_map": True, "obstacle_range": 3.0, "inflation_radius": 0.5,
            "footprint": [[-0.1, -0.1], [0.1, 0], [-0.1, 0.1]], "map_type": "costmap",
            "observation_sources": "scan", "scan": SCAN,
        }
    )  # fmt: skip
    assert not problems
    assert parameters == CostmapParameters(
        update_frequency=10.0, static_map=True, obstacle_range=3.0, inflation_radius=0.5,
        footprint=((-0.1, -0.1), (0.1, 0.0), (-0.1, 0.1)),
        sources=(ObservationSource("scan", "front", "LaserScan", clearing=True),),
    )  # fmt: skip


def test_defaults_are_those_of_noetic() -> None:
    parameters, _ = read({})
    assert parameters.inflation_radius == 0.55
    assert parameters.cost_scaling_factor == 10.0
    assert (parameters.obstacle_range, parameters.raytrace_range) == (2.5, 3.0)
    assert (parameters.width, parameters.resolution, parameters.update_frequency) == (10, 0.05, 5)
    assert not parameters.static_map


def test_a_layered_file_is_read() -> None:
    parameters, problems = read(
        {
            "plugins": LAYERS,
            "obstacles": {
                "observation_sources": "scan", "scan": SCAN | {"obstacle_range": 1.5},
                "raytrace_range": 4.0, "enabled": True,
            },
            "around": {"inflation_radius": 0.3, "cost_scaling_factor": 2},
        }
    )  # fmt: skip
    assert not problems
    assert parameters.static_map
    assert parameters.obstacle_layer_name == "obstacles"
    assert (parameters.inflation_radius, parameters.cost_scaling_factor) == (0.3, 2.0)
    assert parameters.raytrace_range == 4.0
    assert parameters.sources[0].obstacle_range == 1.5


def test_layers_that_are_not_listed_are_not_there() -> None:
    parameters, _ = read({"plugins": LAYERS[:1], "rolling_window": False})
    assert not parameters.obstacle_layer
    assert not parameters.inflation_layer


def test_flat_parameters_do_not_reach_layers() -> None:
    parameters, problems = read({"plugins": LAYERS, "inflation_radius": 0.3})
    assert parameters.inflation_radius == 0.55
    assert "write it under around" in problems[0]


def test_a_flat_source_does_not_reach_a_layer() -> None:
    parameters, problems = read(
        {"plugins": LAYERS, "obstacles": {"observation_sources": "scan"}, "scan": SCAN}
    )
    assert parameters.sources == (ObservationSource("scan", "scan"),)
    assert "does not reach the layer obstacles" in problems[0]


@pytest.mark.parametrize(
    "plugin", ["costmap_2d::VoxelLayer", "range_sensor_layer::RangeSensorLayer"]
)
def test_other_layers_are_refused_by_name(plugin: str) -> None:
    said = refusal({"plugins": [*LAYERS, {"name": "more", "type": plugin}]})
    assert plugin in said
    assert "supported: costmap_2d::StaticLayer" in said


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"map_type": "voxel"}, "map_type"),
        ({"static_map": True, "rolling_window": True}, "exclude each other"),
        ({"footprint": [[0.1, 0.0], [-0.1, 0.0]]}, "global_costmap/footprint"),
        ({"inflation_radius": -0.5}, "inflation_radius"),
        ({"plugins": ["static_layer"]}, "plugins[0]: must be a layer"),
        ({"observation_sources": "scan", "scan": {"observation_persistence": 1.0}}, "latest scan"),
        ({"obstacle_layer": {"obstacle_range": "far"}}, "obstacle_layer/obstacle_range"),
    ],
)
def test_what_cannot_be_is_refused(given: dict[str, Any], said: str) -> None:
    assert said in refusal(given)


def test_unknown_names_are_named_with_their_place() -> None:
    _, problems = read({"inflation_layer": {"inflation_radios": 0.3}})
    assert "move_base/global_costmap/inflation_layer/inflation_radios" in problems[0]
    assert "inflation_radius" in problems[0]


def test_what_has_no_effect_is_told() -> None:
    report = FindingCollector()
    read_costmap(
        {"transform_tolerance": 2.0, "observation_sources": "scan", "scan": SCAN}, (), report
    )
    assert [finding.path[-1] for finding in report.without_effect] == [
        "sensor_frame",
        "transform_tolerance",
    ]


def test_models_check_themselves() -> None:
    with pytest.raises(ValidationError, match="combination_method"):
        CostmapParameters(combination_method=0)
