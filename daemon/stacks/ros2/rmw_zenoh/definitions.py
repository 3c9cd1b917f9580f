"""Interface definitions that a participant without ROS needs, by distribution: fields alone.

Messages of the common packages come from rosbags; here is what it lacks: services, the messages
and actions of Nav2. Fields, their order and types are those published on docs.ros.org for
``nav2_msgs`` of Humble, Jazzy and Kilted; of Lyrical only ``NavigateToPose`` was read in source,
its other actions are taken to be Kilted's. Constants and comments are no part of a type.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

DISTRIBUTIONS: Final = ("humble", "jazzy", "kilted", "lyrical")

_COMMON: Final = {
    "action_msgs/srv/CancelGoal": """
        GoalInfo goal_info
        ---
        int8 return_code
        GoalInfo[] goals_canceling
    """,
    "lifecycle_msgs/srv/GetState": """
        ---
        State current_state
    """,
    "lifecycle_msgs/srv/ChangeState": """
        Transition transition
        ---
        bool success
    """,
    "rcl_interfaces/srv/GetParameters": """
        string[] names
        ---
        ParameterValue[] values
    """,
    "nav2_msgs/msg/Particle": """
        geometry_msgs/Pose pose
        float64 weight
    """,
    "nav2_msgs/msg/ParticleCloud": """
        std_msgs/Header header
        Particle[] particles
    """,
}

_FEEDBACK: Final = """
        geometry_msgs/PoseStamped current_pose
        builtin_interfaces/Duration navigation_time
        builtin_interfaces/Duration estimated_time_remaining
        int16 number_of_recoveries
        float32 distance_remaining
"""

_HUMBLE: Final = {
    "nav2_msgs/action/NavigateToPose": f"""
        geometry_msgs/PoseStamped pose
        string behavior_tree
        ---
        std_msgs/Empty result
        ---
        {_FEEDBACK}
    """,
    "nav2_msgs/action/NavigateThroughPoses": f"""
        geometry_msgs/PoseStamped[] poses
        string behavior_tree
        ---
        std_msgs/Empty result
        ---
        {_FEEDBACK}
        int16 number_of_poses_remaining
    """,
    "nav2_msgs/action/FollowWaypoints": """
        geometry_msgs/PoseStamped[] poses
        ---
        int32[] missed_waypoints
        ---
        uint32 current_waypoint
    """,
}

_JAZZY: Final = {
    "nav2_msgs/msg/MissedWaypoint": """
        uint32 index
        geometry_msgs/PoseStamped goal
        uint16 error_code
    """,
    "nav2_msgs/action/NavigateToPose": f"""
        geometry_msgs/PoseStamped pose
        string behavior_tree
        ---
        uint16 error_code
        string error_msg
        ---
        {_FEEDBACK}
    """,
    "nav2_msgs/action/NavigateThroughPoses": f"""
        geometry_msgs/PoseStamped[] poses
        string behavior_tree
        ---
        uint16 error_code
        string error_msg
        ---
        {_FEEDBACK}
        int16 number_of_poses_remaining
    """,
    "nav2_msgs/action/FollowWaypoints": """
        uint32 number_of_loops
        uint32 goal_index
        geometry_msgs/PoseStamped[] poses
        ---
        MissedWaypoint[] missed_waypoints
        uint16 error_code
        string error_msg
        ---
        uint32 current_waypoint
    """,
}

_KILTED: Final = {
    "nav2_msgs/msg/WaypointStatus": """
        uint8 waypoint_status
        uint32 waypoint_index
        geometry_msgs/PoseStamped waypoint_pose
        uint16 error_code
        string error_msg
    """,
    "nav2_msgs/action/NavigateToPose": _JAZZY["nav2_msgs/action/NavigateToPose"],
    "nav2_msgs/action/NavigateThroughPoses": f"""
        nav_msgs/Goals poses
        string behavior_tree
        ---
        uint16 error_code
        string error_msg
        WaypointStatus[] waypoint_statuses
        ---
        {_FEEDBACK}
        int16 number_of_poses_remaining
        WaypointStatus[] waypoint_statuses
    """,
    "nav2_msgs/action/FollowWaypoints": """
        uint32 number_of_loops
        uint32 goal_index
        geometry_msgs/PoseStamped[] poses
        ---
        WaypointStatus[] missed_waypoints
        uint16 error_code
        string error_msg
        ---
        uint32 current_waypoint
    """,
}

_LYRICAL: Final = _KILTED | {
    "nav2_msgs/action/NavigateToPose": f"""
        geometry_msgs/PoseStamped pose
        string behavior_tree
        ---
        uint16 error_code
        string error_msg
        ---
        {_FEEDBACK}
        float32 position_tracking_error
        float32 heading_tracking_error
    """,
}

SHIPPED: Final[Mapping[str, Mapping[str, str]]] = {
    "humble": _COMMON | _HUMBLE,
    "jazzy": _COMMON | _JAZZY,
    "kilted": _COMMON | _KILTED,
    "lyrical": _COMMON | _LYRICAL,
}
"""Texts as in ``.msg``, ``.srv`` and ``.action`` files, by distribution and name."""
