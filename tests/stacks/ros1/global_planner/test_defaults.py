"""What counts when nothing is written: the defaults of Noetic's GlobalPlanner."""

from dataclasses import asdict

from daemon.stacks.ros1.global_planner import GlobalPlannerParameters


def test_defaults_are_those_of_noetic():
    """``GlobalPlanner.cfg`` and ``GlobalPlanner::initialize``."""
    assert asdict(GlobalPlannerParameters()) == {
        "old_navfn_behavior": False, "use_quadratic": True, "use_dijkstra": True,
        "use_grid_path": False, "allow_unknown": True, "outline_map": True, "lethal_cost": 253,
        "neutral_cost": 50, "cost_factor": 3.0, "orientation_mode": 1,
        "orientation_window_size": 1, "default_tolerance": 0.0, "publish_potential": True,
        "publish_scale": 100, "planner_window_x": 0.0, "planner_window_y": 0.0,
    }  # fmt: skip
