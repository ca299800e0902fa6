"""Emulated Dynamixel motors and their bus."""
