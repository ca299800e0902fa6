"""ROBOTIS OpenMANIPULATOR-X over Dynamixel protocol 2.0, under current control, feeling by its motor currents.

Owns the packets, the registers, the bus, the arm's mechanics and the control at the bus rate. Knows neither the tick
nor the network.
"""
