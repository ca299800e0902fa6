"""Dynamixel motors, protocol 2.0: packets, registers, the bus, and the motors of an arm on it."""
