"""ROS 2 topics, judged by zenoh-ros2-sdk, a client that others wrote."""
