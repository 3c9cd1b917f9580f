"""AMCL: adaptive Monte Carlo localisation of ROS Noetic.

Written anew from the behaviour of the package (navigation ``noetic-devel``) after Thrun, Burgard
and Fox, Probabilistic Robotics (2005), and Fox (2003).
"""

from daemon.stacks.ros1.amcl._parameters import AmclParameters

__all__ = ["AmclParameters"]
