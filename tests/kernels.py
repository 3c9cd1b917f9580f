"""``python -m tests.kernels``: compile what tests and benchmarks call, or load it."""

from dataclasses import replace
from pathlib import Path

from daemon.campaign import expand, load_campaign
from daemon.run import load_kernels
from daemon.stacks.ros1.quirks import FAST

CAMPAIGNS = Path(__file__).parents[1] / "campaigns"
OTHER_PLANNERS = {
    "base_global_planner": "global_planner/GlobalPlanner",
    "base_local_planner": "base_local_planner/TrajectoryPlannerROS",
}


def runs():
    """Yield a run of each system that has kernels, and its scene."""
    for name in ("demo", "ortega2024"):
        submission = expand(load_campaign(CAMPAIGNS / name / "campaign.yaml"))
        scenes = {scene.digest: scene for scene in submission.scenes}
        first = {spec.sut.name: spec for spec in reversed(list(submission.specs))}
        for spec in first.values():
            yield spec, scenes[spec.scene]
        if "a2s" in first:
            spec = first["a2s"]
            tree = dict(spec.sut.parameters)
            tree["move_base"] = {**tree["move_base"], **OTHER_PLANNERS}
            yield replace(spec, sut=replace(spec.sut, parameters=tree)), scenes[spec.scene]


def load_all():
    """Compile or load the kernels of all these."""
    for spec, scene in runs():
        load_kernels(spec, scene)


def load_rare():
    """Compile or load what only tests call: costmaps that few have, and a plain version."""
    # Here, for benchmarks load the others only.
    import numpy as np

    from tests.stacks.ros1.costmap.test_plain import any_layers, compare, random_costmap
    from tests.stacks.ros1.dwa.helpers import A2S, random_problem

    random_problem(np.random.default_rng(1), A2S).plain()
    for seed in range(12):
        random = np.random.default_rng(seed)
        quirks = replace(FAST, inflation_queue_order=bool(seed % 2))
        layers = any_layers(random)
        rolling = replace(random_costmap(random, layers), frame="odom", rolling_window=True)
        compare(rolling, random, 4, quirks)


if __name__ == "__main__":
    load_all()
    load_rare()
