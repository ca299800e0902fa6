"""Pictures of the robot for the operator: sources, their way between hosts, and the process that carries them."""
