"""Discovery of USB devices, ports, the thread and the guardian process of a driver, and emulated devices."""
