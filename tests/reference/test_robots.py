"""What the files of published robots come to: the layers move_base would make of each."""

import pytest

from campaigns.studies.published_robots import SUTS
from daemon.campaign import LayerLibrary
from daemon.stacks.ros1.configuration import read_ros
from grammars.text.diagnostics import InputError
from grammars.text.ros_yaml import load_ros_yaml
from tests.campaign.test_suts import parameters
from tests.stacks.ros1.sections import said, shown

NAMES = (
    "fetch", "husky", "husky-trajectory", "jackal", "mir100", "mir100-dwa", "robile-amr", "tiago",
    "tiago-dwa", "turtlebot2", "turtlebot3-burger",
)  # fmt: skip


def load(reference_data, folder, name, parameters=None):
    """Load a robot as it is described, or with other ``parameters`` over its launch files."""
    text = (SUTS / f"{name}.yaml").read_text("utf-8")
    if parameters is not None:
        text = text.partition("parameters:\n")[0] + parameters
    path = folder / f"{name}.yaml"
    path.write_text(text.replace("ROBOTS/", f"{reference_data / 'robots'}/"), "utf-8")
    return read_ros(LayerLibrary(folder).sut_file(path).reference.parameters)


def test_published_robots_have_the_layers_their_files_describe(reference_data, tmp_path, golden):
    """Planners of others are refused by name at their lines; TIAGo also as it is launched."""
    told = []
    for name, *changes in (*((name,) for name in NAMES), ("tiago-dwa", "")):
        told.append(f"--- {name}{' as it is launched' if changes else ''}")
        try:
            read = load(reference_data, tmp_path, name, *changes)
        except InputError as error:
            told += [f"error {finding}" for finding in error.findings]
            continue
        told += shown(read.local_planner)
        for scope in ("global_costmap", "local_costmap"):
            told += [f"{scope}: {line}" for line in shown(getattr(read, scope))]
        told += [line for line in said((), read.findings) if line.startswith("warning")]
    text = "\n".join(told) + "\n"
    text = text.replace(str(tmp_path), "SUTS").replace(str(reference_data / "robots"), "ROBOTS")
    golden("robots.txt", text)


@pytest.mark.parametrize("name", ["a2s", "fro-diff", "fro-omni"])
def test_our_configurations_have_the_published_figures(campaigns, reference_data, name):
    def published(file):
        return load_ros_yaml(reference_data / "suts" / name / f"{file}.yaml")[0].data

    common, local, global_ = (
        published(f"costmap_{n}_params") for n in ("common", "local", "global")
    )
    costmaps = {
        "local_costmap": common | local["local_costmap"],
        "global_costmap": common | global_["global_costmap"],
    }
    ours = parameters(campaigns, name)
    assert ours["amcl"] == published("amcl")
    assert ours["move_base"] == (
        published("move_base_params") | published("dwa_local_planner_params") | costmaps
    )
