"""ROS 2 topics over Zenoh without ROS: the bridge, and the device `ros2`."""
