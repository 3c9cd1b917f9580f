"""base_local_planner of ROS Noetic: shared parts of the sampling controllers.

The plan near the robot, distances from it on the local costmap, and the cost of a footprint.
"""
