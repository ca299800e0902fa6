"""The robot `franka`: a Franka FR3 over its control interface (FCI), with the control loop in a process of its own."""
