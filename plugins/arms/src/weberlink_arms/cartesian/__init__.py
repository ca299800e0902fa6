"""ROBOTIS OpenMANIPULATOR-X over Dynamixel protocol 2.0, under current control, with forces from motor currents."""
