"""The driver `franka` against franka-sim, a third party's simulator of the robot's controller."""
