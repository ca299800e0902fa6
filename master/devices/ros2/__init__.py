"""A hand led by a ROS 2 topic; a process of its own listens, so the daemon imports no Zenoh."""
