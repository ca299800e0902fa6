"""Arms with Dynamixel and Feetech servos: leaders, followers, a robot, models, and emulators."""
