"""Every section of ROS parameters: its defaults, what it refuses and what it doubts.

``defaults.txt`` has the defaults of Noetic (the ``.cfg`` files, and ``initialize`` of each part),
``objections.txt`` what is said of values: a head is ``--- BASE {changes}``, what follows all that
is said of it. Write a new head into it and let ``pytest --update`` fill in the rest.
"""

from dataclasses import asdict, replace
from pathlib import Path

import yaml
from pydantic import ValidationError

from daemon.stacks.findings import FindingCollector
from daemon.stacks.pilot import PilotParameters
from daemon.stacks.ros1.amcl import AmclParameters
from daemon.stacks.ros1.costmap.layers import (
    InflationLayer,
    LayeredCostmap,
    ObservationSource,
    ObstacleLayer,
    StaticLayer,
    VoxelLayer,
)
from daemon.stacks.ros1.dwa import DwaParameters
from daemon.stacks.ros1.move_base import (
    ClearCostmapParameters,
    DispatcherParameters,
    MoveBaseParameters,
    RotateRecoveryParameters,
)
from daemon.stacks.ros1.navfn import GlobalPlannerParameters, NavfnParameters
from daemon.stacks.ros1.parameters import ParameterNamespace, read_section
from daemon.stacks.ros1.trajectory_planner import TrajectoryPlannerParameters
from tests.stacks.cases import cases, written
from tests.stacks.ros1.dwa.helpers import A2S, OMNI
from tests.stacks.ros1.trajectory_planner.helpers import ROBOTS

OBJECTIONS = Path(__file__).with_name("objections.txt")
SECTIONS = {
    "amcl": AmclParameters(),
    "navfn": NavfnParameters(),
    "global planner": GlobalPlannerParameters(),
    "move_base": MoveBaseParameters(),
    "clear costmap": ClearCostmapParameters(),
    "rotate": RotateRecoveryParameters(),
    "dispatcher": DispatcherParameters(),
    "dwa": DwaParameters(),
    "trajectory planner": TrajectoryPlannerParameters(),
    "costmap": LayeredCostmap(),
    "static": StaticLayer(),
    "obstacles": ObstacleLayer(),
    "voxels": VoxelLayer(),
    "inflation": InflationLayer(),
    "source": ObservationSource("scan", "/scan"),
}
# Reaches 0.1 m/s and 0.2 rad/s within a period of 0.1 s: too little of both.
SLOW = replace(
    A2S, acc_lim_x=1.0, acc_lim_y=0.0, acc_lim_theta=2.0, min_vel_trans=0.11, min_vel_theta=0.5,
    controller_frequency=10.0,
)  # fmt: skip
BASES = SECTIONS | {
    "a2s": A2S,
    "omni": OMNI,
    "slow": SLOW,
    **{name: robot.parameters for name, robot in ROBOTS.items()},
}


def test_defaults_are_those_of_noetic(golden):
    shown = []
    for name, section in (SECTIONS | {"pilot": PilotParameters()}).items():
        values = asdict(section)
        shown += [f"--- {name}", *(f"{key} = {value!r}" for key, value in values.items())]
        idle = getattr(section, "without_effect", {})
        shown += [f"without effect: {key}" for key in sorted(idle)]
    golden("defaults.txt", "\n".join(shown) + "\n")


def objections(head):
    """Return all that is said of a base with changed values, a line each."""
    name, _, changes = head.partition(" {")
    changes = yaml.safe_load("{" + changes)
    base, model = asdict(BASES[name]), type(BASES[name])
    try:
        rules = model(**base | changes).rules()
    except ValidationError:
        report = FindingCollector()
        read_section(model, ParameterNamespace.of(changes, ()), report, inherited=base)
        return [f"error {problem}" for problem in report.fatal]
    return [
        f"{'error' if rule.fatal else 'doubt'} {' '.join(rule.names)}: {rule.text}"
        for rule in rules
    ]


def test_every_objection_to_a_value_is_as_written(golden):
    told = [line for head, _ in cases(OBJECTIONS) for line in written((head, []), objections(head))]
    golden(OBJECTIONS.name, "\n".join(told) + "\n")
