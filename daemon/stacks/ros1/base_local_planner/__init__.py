"""base_local_planner of ROS Noetic: what the sampling controllers stand on.

The plan near the robot, distances from it on the local costmap, and what a footprint lies on.
"""
