"""What the files of published robots come to: the layers move_base would make of each."""

import pytest

from campaigns.studies.published_robots.folder import SUTS
from daemon.campaign import LayerLibrary
from daemon.stacks.ros1.configuration import read_ros
from daemon.stacks.ros1.costmap import InflationLayer, ObstacleLayer, StaticLayer, VoxelLayer
from daemon.stacks.ros1.dwa import DwaParameters
from daemon.stacks.ros1.trajectory_planner import TrajectoryPlannerParameters
from grammars.text.diagnostics import InputError


def load(reference_data, folder, name, parameters=None):
    """Load a robot as it is described, or with other ``parameters`` over its launch files."""
    text = (SUTS / f"{name}.yaml").read_text("utf-8")
    if parameters is not None:
        text = text.partition("parameters:\n")[0] + parameters
    path = folder / f"{name}.yaml"
    path.write_text(text.replace("ROBOTS/", f"{reference_data / 'robots'}/"), "utf-8")
    return read_ros(LayerLibrary(folder).sut_file(path).reference.parameters)


def layers(costmap):
    words = []
    for layer in costmap.layers:
        kind = {StaticLayer: "map", InflationLayer: "inflation"}.get(type(layer), "obstacles")
        if isinstance(layer, ObstacleLayer):
            kind = "voxels" if isinstance(layer, VoxelLayer) else "obstacles"
        words.append(f"{layer.name} ({kind})")
    return words


@pytest.mark.parametrize(
    ("name", "planner", "wide", "near", "frames"),
    [
        ("fetch", TrajectoryPlannerParameters,
         ["static_map (map)", "obstacles (voxels)", "inflater (inflation)"],
         ["obstacles (voxels)", "inflater (inflation)"], ("map", "odom")),
        ("husky", DwaParameters,
         ["static (map)", "inflation (inflation)"],
         ["obstacles_laser (obstacles)", "inflation (inflation)"], ("map", "odom")),
        ("husky-trajectory", TrajectoryPlannerParameters,
         ["static (map)", "inflation (inflation)"],
         ["obstacles_laser (obstacles)", "inflation (inflation)"], ("map", "odom")),
        ("jackal", TrajectoryPlannerParameters,
         ["static_layer (map)", "obstacles_layer (obstacles)", "inflater_layer (inflation)"],
         ["obstacles_layer (obstacles)", "inflater_layer (inflation)"], ("map", "map")),
        ("mir100-dwa", DwaParameters,
         ["navigation_map (map)", "obstacles (voxels)", "inflation (inflation)"],
         ["obstacles (voxels)", "inflation (inflation)"], ("map", "odom")),
        ("robile-amr", TrajectoryPlannerParameters,
         ["static_layer (map)", "obstacle_layer (obstacles)", "inflation_layer (inflation)"],
         ["obstacle_layer (obstacles)", "inflation_layer (inflation)"], ("map", "map")),
        ("turtlebot2", DwaParameters,
         ["static_layer (map)", "obstacle_layer (voxels)", "inflation_layer (inflation)"],
         ["obstacle_layer (voxels)", "inflation_layer (inflation)"], ("map", "odom")),
        ("turtlebot3-burger", DwaParameters,
         ["static_layer (map)", "obstacle_layer (obstacles)", "inflation_layer (inflation)"],
         ["obstacle_layer (obstacles)", "inflation_layer (inflation)"], ("map", "odom")),
    ],
)  # fmt: skip
def test_published_robots_have_the_layers_their_files_describe(
    reference_data, tmp_path, name, planner, wide, near, frames
):
    read = load(reference_data, tmp_path, name)
    assert isinstance(read.local_planner, planner)
    assert layers(read.global_costmap) == wide
    assert layers(read.local_costmap) == near
    assert (read.global_costmap.frame, read.local_costmap.frame) == frames


def test_mir_finds_its_footprint_upwards_and_its_ranges_per_costmap(reference_data, tmp_path):
    read = load(reference_data, tmp_path, "mir100-dwa")
    for costmap, reach in ((read.global_costmap, 2.0), (read.local_costmap, 6.0)):
        assert costmap.footprint == ((0.506, -0.32), (0.506, 0.32), (-0.454, 0.32), (-0.454, -0.32))
        (seen,) = (layer for layer in costmap.layers if isinstance(layer, ObstacleLayer))
        assert {source.raytrace_range for source in seen.sources} == {reach}
        assert {source.topic for source in seen.sources} == {"/b_scan_rep117", "/f_scan_rep117"}


def test_tiago_keeps_every_layer_that_is_on(reference_data, tmp_path):
    with pytest.raises(InputError) as caught:
        load(reference_data, tmp_path, "tiago-dwa", "")
    found = [str(problem) for problem in caught.value.findings]
    assert len(found) == 2
    assert "the static layer listens to /vo_map, the map of the run is on /map" in found[0]
    assert "nothing is published on /rgbd_scan here" in found[1]
    read = load(reference_data, tmp_path, "tiago-dwa")
    seen = ["obstacle_laser_layer (obstacles)", "obstacle_rgbd_layer (obstacles)"]
    assert layers(read.local_costmap) == [*seen, "inflation_layer (inflation)"]
    assert layers(read.global_costmap) == [
        "static_layer (map)",
        *seen,
        "inflation_layer (inflation)",
    ]


@pytest.mark.parametrize(
    ("name", "refused"),
    [("mir100", ["SBPLLatticePlanner", "nav_core_adapter::LocalPlannerAdapter"]),
     ("tiago", ["pal_local_planner/PalLocalPlanner"])],
)  # fmt: skip
def test_planners_of_others_are_refused_by_name_at_their_lines(
    reference_data, tmp_path, name, refused
):
    with pytest.raises(InputError) as caught:
        load(reference_data, tmp_path, name)
    found = [str(problem) for problem in caught.value.findings]
    for plugin in refused:
        assert any(plugin in problem for problem in found), found
    assert all(".yaml:" in problem or ".launch:" in problem for problem in found)
