"""Processes that start others, watch them, and leave nothing of them.

The guardian of a run's process, and the supervisor of a ROS 2 stack. Standard library only,
imported relatively: a supervisor runs in a Python without our packages, as a package of its own, so
that it is small and starts at once.
"""
