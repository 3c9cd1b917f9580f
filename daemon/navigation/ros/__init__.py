"""The ROS navigation stack as people run it: AMCL, costmap_2d, navfn, DWA, move_base.

Written anew from the published behaviour of the ROS 1 Noetic packages, configured by the YAML
files people already have, quirks included (:mod:`daemon.navigation.ros.quirks`).
"""
