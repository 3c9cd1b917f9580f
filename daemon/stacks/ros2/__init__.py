"""ROS 2 stacks of their users, as they start them, in lock step with the simulation.

A link (:mod:`daemon.stacks.ros2.link`) talks to a stack by a relay that runs in the stack's own
ROS 2.
"""
