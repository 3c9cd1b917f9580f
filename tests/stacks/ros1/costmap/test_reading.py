"""Files of people, with and without ``plugins``: the layers move_base would make of them."""

from dataclasses import replace

import pytest

from daemon.stacks.findings import FindingCollector, ParameterError
from daemon.stacks.ros1.costmap.layers import (
    InflationLayer,
    LayeredCostmap,
    ObservationSource,
    ObstacleLayer,
    StaticLayer,
    VoxelLayer,
)
from daemon.stacks.ros1.costmap.reading import CostmapContext, CostmapReader

PLACE = ("move_base", "global_costmap")
SCAN = {"data_type": "LaserScan", "topic": "front", "marking": True, "clearing": True}
HEARD = ObservationSource("scan", "/front", "LaserScan", clearing=True)
SEEN = ObstacleLayer(sources=(HEARD,), observation_sources="scan")
LAYERS = [
    {"name": "walls", "type": "costmap_2d::StaticLayer"},
    {"name": "obstacles", "type": "costmap_2d::ObstacleLayer"},
    {"name": "around", "type": "costmap_2d::InflationLayer"},
]
OBSTACLES = {"observation_sources": "scan", "scan": SCAN}


def collect(given, **options):
    report = FindingCollector()
    context = CostmapContext(
        above={},
        frames={"map": "map", "odom": "odom"},
        resolve=lambda name: f"/{name.lstrip('/')}",
        maps=("/map",),
        may_carry_scan=lambda topic: True,
    )
    return CostmapReader(given, PLACE, report, replace(context, **options)).read(), report


def read(given, **options):
    costmap, report = collect(given, **options)
    return costmap, [str(problem) for problem in report.findings().problems]


def idle(given, **options):
    _, report = collect(given, **options)
    return {
        "/".join(map(str, finding.path[2:])): finding.message
        for finding in report.findings().without_effect
    }


def refusals(given, **options):
    with pytest.raises(ParameterError) as error:
        read(given, **options)
    return [str(problem) for problem in error.value.problems]


def obstacle_layer(costmap):
    (layer,) = (layer for layer in costmap.layers if isinstance(layer, ObstacleLayer))
    return layer


def test_a_flat_file_is_read():
    costmap, problems = read(
        {
            "global_frame": "map", "robot_base_frame": "base_link", "update_frequency": 10,
            "static_map": True, "obstacle_range": 3.0, "inflation_radius": 0.5,
            "footprint": [[-0.1, -0.1], [0.1, 0], [-0.1, 0.1]], "map_type": "costmap",
            "observation_sources": "scan", "scan": SCAN,
        }
    )  # fmt: skip
    assert not problems
    source = replace(HEARD, obstacle_range=3.0)
    assert costmap == LayeredCostmap(
        layers=(
            StaticLayer(),
            replace(SEEN, sources=(source,), obstacle_range=3.0),
            InflationLayer(inflation_radius=0.5),
        ),
        update_frequency=10.0,
        footprint=((-0.1, -0.1), (0.1, 0.0), (-0.1, 0.1)),
    )


def test_defaults_are_those_of_noetic():
    costmap, problems = read({})
    assert not problems
    assert costmap == LayeredCostmap(layers=(ObstacleLayer(), InflationLayer()))
    assert costmap.layers[1] == InflationLayer(
        inflation_radius=0.55, cost_scaling_factor=10.0, inflate_unknown=False
    )
    assert (costmap.width, costmap.resolution, costmap.update_frequency) == (10, 0.05, 5)
    flat, _ = read(OBSTACLES)
    (source,) = obstacle_layer(flat).sources
    assert (source.obstacle_range, source.raytrace_range) == (2.5, 3.0)


def test_a_layered_file_is_read_in_its_order():
    costmap, problems = read(
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
    source = replace(HEARD, obstacle_range=1.5, raytrace_range=4.0)
    assert costmap.layers == (
        StaticLayer("walls"),
        replace(SEEN, name="obstacles", sources=(source,), raytrace_range=4.0),
        InflationLayer("around", inflation_radius=0.3, cost_scaling_factor=2.0),
    )


def test_several_obstacle_layers_are_all_kept_and_those_that_are_off_are_not():
    # As TIAGo has it: the laser in one layer, three other sensors in three more.
    kinds = dict.fromkeys(("laser", "sonar", "rgbd"), "costmap_2d::ObstacleLayer")
    sonar = {"data_type": "PointCloud2", "expected_update_rate": 1.0}
    given = {
        "plugins": [{"name": name, "type": kind} for name, kind in kinds.items()],
        "laser": OBSTACLES | {"combination_method": 0, "enabled": True},
        "sonar": {"enabled": False, "observation_sources": "cloud", "cloud": sonar},
        "rgbd": {"observation_sources": "rgbd", "rgbd": SCAN | {"topic": "rgbd_scan"}},
    }
    costmap, problems = read(given)
    assert not problems
    rgbd = replace(HEARD, name="rgbd", topic="/rgbd_scan")
    assert costmap.layers == (
        replace(SEEN, name="laser", combination_method=0),
        replace(SEEN, name="rgbd", sources=(rgbd,), observation_sources="rgbd"),
    )
    assert idle(given) == {
        "sonar/observation_sources": "the layer sonar is off",
        "sonar/cloud": "the layer sonar is off",
    }


def test_a_static_layer_that_is_off_takes_the_map_out_of_a_rolling_window_only():
    given = {"plugins": LAYERS, "walls": {"enabled": False}}
    costmap, _ = read(given | {"rolling_window": True})
    assert [layer.name for layer in costmap.layers] == ["obstacles", "around"]
    (said,) = refusals(given)
    assert "walls/enabled: a static layer that is off still gives the costmap the size" in said


def test_a_layer_may_be_called_like_a_parameter():
    # fetch_navigation calls its static layer static_map, and sets static_map besides.
    plugins = [{"name": "static_map", "type": "costmap_2d::StaticLayer"}]
    costmap, problems = read({"plugins": plugins, "static_map": True})
    assert (costmap.layers, problems) == ((StaticLayer("static_map"),), [])
    space = {"plugins": plugins, "static_map": {"use_maximum": True}}
    costmap, problems = read(space)
    assert (costmap.layers, problems) == ((StaticLayer("static_map", use_maximum=True),), [])


def test_footprint_and_radius_are_found_upwards():
    # As MiR and PR2 write them, in the namespace of move_base.
    box = [[0.5, -0.3], [0.5, 0.3], [-0.4, 0.3], [-0.4, -0.3]]
    costmap, _ = read({}, above={"footprint": box})
    assert costmap.footprint == ((0.5, -0.3), (0.5, 0.3), (-0.4, 0.3), (-0.4, -0.3))
    nearest, _ = read({"footprint": "[[0.1, -.1], [0.1, 1.], [-1, 0]]"}, above={"footprint": box})
    assert nearest.footprint == ((0.1, -0.1), (0.1, 1.0), (-1.0, 0.0))
    # A footprint anywhere comes before a radius, however near that is.
    radius, _ = read({"robot_radius": 0.2}, above={"footprint": box})
    assert radius.footprint is not None
    for none in ("[]", "", []):
        empty, _ = read({"footprint": none, "robot_radius": 0.2}, above={"footprint": box})
        assert (empty.footprint, empty.robot_radius) == (None, 0.2)
    above, _ = read({}, above={"robot_radius": 0.3})
    assert above.robot_radius == 0.3


def test_ranges_are_found_upwards_from_the_source():
    ranges = {"obstacle_range": 4.0}
    voxel = [{"name": "v", "type": "costmap_2d::VoxelLayer"}]
    for given, above, expected in (
        ({"v": OBSTACLES | {"scan": SCAN | ranges, "obstacle_range": 5.0}}, {}, 4.0),
        ({"v": OBSTACLES | ranges, "obstacle_range": 5.0}, {}, 4.0),
        ({"v": OBSTACLES} | ranges, {"obstacle_range": 5.0}, 4.0),
        ({"v": OBSTACLES}, ranges, 4.0),
        ({"v": OBSTACLES}, {}, 2.5),
    ):
        costmap, problems = read({"plugins": voxel, **given}, above=above)
        assert problems == []
        assert obstacle_layer(costmap).sources[0].obstacle_range == expected


def test_the_costmaps_own_parameters_are_copied_into_layers():
    # costmap_2d_ros.cpp copyParentParameters, since Melodic.
    given = {
        "plugins": LAYERS, "inflation_radius": 0.3, "track_unknown_space": False,
        "obstacle_range": 4.0, "obstacles": OBSTACLES, "around": {"inflation_radius": 1.0},
    }  # fmt: skip
    costmap, problems = read(given)
    static, obstacles, inflation = costmap.layers
    assert static == StaticLayer("walls", track_unknown_space=False)
    assert isinstance(obstacles, ObstacleLayer)
    assert obstacles.sources[0].obstacle_range == 4.0
    assert inflation == InflationLayer("around", inflation_radius=0.3)
    assert problems == [
        "move_base/global_costmap/around/inflation_radius: costmap_2d writes the costmap's own "
        "inflation_radius over it, which is 0.3; write it in one of the two places"
    ]


def test_unknown_space_is_tracked_by_the_costmap_and_by_each_layer():
    given = {"plugins": LAYERS, "obstacles": {"track_unknown_space": True}}
    costmap, _ = read(given)
    assert not costmap.track_unknown_space
    assert obstacle_layer(costmap).track_unknown_space
    whole, _ = read({"plugins": LAYERS, "track_unknown_space": True})
    assert whole.track_unknown_space
    assert obstacle_layer(whole).track_unknown_space
    # A voxel layer is not given it, and takes that of the costmap for its default.
    voxels = [{"name": "v", "type": "costmap_2d::VoxelLayer"}]
    tracked, _ = read({"plugins": voxels, "track_unknown_space": True})
    assert obstacle_layer(tracked).track_unknown_space
    free, _ = read(
        {"plugins": voxels, "track_unknown_space": True, "v": {"track_unknown_space": False}}
    )
    assert not obstacle_layer(free).track_unknown_space


def test_a_voxel_layer_is_read_with_or_without_plugins():
    # turtlebot_navigation keeps its parameters below obstacle_layer, as map_type has it.
    own = OBSTACLES | {"z_voxels": 2, "z_resolution": 0.2, "mark_threshold": 0, "origin_z": 0.0}
    costmap, problems = read({"map_type": "voxel", "obstacle_layer": own})
    assert problems == []
    voxels = VoxelLayer(sources=(HEARD,), observation_sources="scan")
    assert obstacle_layer(costmap) == replace(voxels, z_voxels=2)
    flat, problems = read({"map_type": "voxel", "z_voxels": 16, **OBSTACLES})
    assert problems == []
    assert obstacle_layer(flat) == replace(voxels, z_voxels=16)
    assert "must be less than or equal to 16" in refusals({"map_type": "voxel", "z_voxels": 17})[0]


def test_the_depth_layer_of_fetch_is_a_voxel_layer_without_its_camera():
    plugins = [{"name": "obstacles", "type": "costmap_2d::FetchDepthLayer"}]
    own = OBSTACLES | {"z_voxels": 16}
    costmap, problems = read({"plugins": plugins, "obstacles": own})
    assert obstacle_layer(costmap) == VoxelLayer(
        "obstacles", (HEARD,), observation_sources="scan", z_voxels=16
    )
    assert len(problems) == 1
    assert "there is no depth camera" in problems[0]


def test_a_static_layer_may_lie_in_a_rolling_window_and_in_odom():
    given = {"rolling_window": True, "static_map": True, "global_frame": "odom_comb"}
    costmap, problems = read(given, frames={"world": "map", "odom_comb": "odom"})
    assert problems == []
    assert costmap.frame == "odom"
    assert costmap.layers[0] == StaticLayer()
    (said,) = refusals(given)
    assert "amcl's global_frame_id (map) nor amcl's odom_frame_id (odom)" in said


def test_frames_that_tf2_refuses_are_warned_of():
    given = OBSTACLES | {"global_frame": "/map", "robot_base_frame": "/base_link"}
    costmap, problems = read(given | {"scan": SCAN | {"sensor_frame": "/laser"}})
    assert costmap.frame == "map"
    waits = "tf2 refuses frames that begin with a slash: move_base of Noetic waits"
    assert [problem for problem in problems if waits in problem and "write map" in problem]
    assert [problem for problem in problems if waits in problem and "write base_link" in problem]
    assert "drops every scan; write laser" in "\n".join(problems)
    assert len(problems) == 3


def test_a_static_layer_on_another_map_is_refused_with_what_to_do():
    walls = [{"name": "virtual_walls", "type": "costmap_2d::StaticLayer"}]
    given = {"plugins": walls, "virtual_walls": {"map_topic": "/virtual_walls/map"}}
    (said,) = refusals(given)
    assert "virtual_walls/map_topic: the static layer listens to /virtual_walls/map" in said
    assert "enabled: false under virtual_walls" in said
    costmap, _ = read(given, maps=("/map", "/virtual_walls/map"))
    assert costmap.layers == (StaticLayer("virtual_walls", map_topic="/virtual_walls/map"),)


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("pal::SomeLayer", 'no layer of type "pal::SomeLayer" is supported; switch it off'),
        ("ObstacleLayer", "write costmap_2d::ObstacleLayer"),
    ],
)
def test_other_layers_are_refused_by_name_at_their_line(kind, said):
    given = {"plugins": [*LAYERS, {"name": "more", "type": kind}]}
    (found,) = refusals(given)
    assert "plugins[3]" in found
    assert said in found
    costmap, _ = read(given | {"more": {"enabled": False, "whatever": 1}})
    assert len(costmap.layers) == 3


def test_sensors_nobody_has_are_named_and_left_out():
    bump = {"data_type": "PointCloud2", "topic": "bumper"}
    given = {"observation_sources": "scan bump unwritten", "scan": SCAN, "bump": bump}
    costmap, problems = read(given, stops_robot=True)
    assert obstacle_layer(costmap).sources == (HEARD,)
    assert problems == [
        'move_base/global_costmap/bump/data_type: the source "bump" waits for a PointCloud2 on '
        "/bumper; nobody publishes one here, there are only lasers: nothing comes from it",
        'move_base/global_costmap/obstacle_layer/unwritten: the source "unwritten" waits for a '
        "PointCloud on /unwritten (its data_type when none is written); nobody publishes one here, "
        "there are only lasers: nothing comes from it",
    ]


def test_a_silent_sensor_that_stops_move_base_is_an_error_in_the_local_costmap():
    # tiago_2dnav waits for virtual obstacles twelve seconds, then stands still.
    given = {
        "observation_sources": "vo_cloud",
        "vo_cloud": {"data_type": "PointCloud", "expected_update_rate": 12.0},
    }
    (said,) = refusals(given, stops_robot=True)
    assert "vo_cloud/expected_update_rate: nothing is published on /vo_cloud here" in said
    assert "after 12 s" in said
    read(given)
    assert "only if it is one of the local costmap" in idle(given)["vo_cloud/expected_update_rate"]
    heard = OBSTACLES | {"scan": SCAN | {"expected_update_rate": 0.3}}
    costmap, _ = read(heard, stops_robot=True)
    assert obstacle_layer(costmap).sources[0].expected_update_rate == 0.3
    (said,) = refusals(heard, stops_robot=True, may_carry_scan=lambda topic: topic == "/rear")
    assert "nothing is published on /front" in said


def test_what_has_no_effect_is_told():
    found = idle({"transform_tolerance": 2.0, **OBSTACLES, "scan": SCAN | {"sensor_frame": "laser"},
                  "z_voxels": 3, "other": SCAN, "static_map": True, "resolution": 0.1,
                  "unknown_cost_value": 255, "publish_voxel_map": True})  # fmt: skip
    assert set(found) == {
        "transform_tolerance", "scan/sensor_frame", "z_voxels", "other", "resolution",
        "unknown_cost_value", "publish_voxel_map",
    }  # fmt: skip
    assert found["other"] == "no layer of this costmap is called that"
    assert found["resolution"].startswith("the map gives the grid its size")
