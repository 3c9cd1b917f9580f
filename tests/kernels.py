"""``python -m tests.kernels``: compile what tests and benchmarks call, or load it."""

from dataclasses import replace
from pathlib import Path

from daemon.campaign import expand, load_campaign
from daemon.run import load_kernels

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


if __name__ == "__main__":
    load_all()
