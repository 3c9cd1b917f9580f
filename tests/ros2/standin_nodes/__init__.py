"""The nodes of the stand-in navigation stack; they run in a ROS 2 environment, not in ours."""
