"""ROS 2 topics over Zenoh without ROS: names, types and sessions as rmw_zenoh has them."""
