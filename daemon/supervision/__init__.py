"""Processes that start others, watch them, and end them without leftovers.

The guardian of a run's process, and the supervisor of a ROS 2 stack. Standard library only,
with relative imports: a supervisor runs as a package of its own in a Python without our packages,
so that it is small and starts at once.
"""
