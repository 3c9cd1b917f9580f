"""ROS 2 stacks of their users, as they start them, in lock step with the simulation.

What talks to a stack is a link (:mod:`daemon.stacks.ros2.link`): a relay that runs in the stack's
own ROS 2, or a participant that speaks ``rmw_zenoh``.
"""
