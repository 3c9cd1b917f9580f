"""Against a genuine ROS 2: rclpy and Fast DDS from wheels, a stand-in navigation stack."""
