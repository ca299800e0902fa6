"""The emulated boards of the Polhem; their drivers are of the kernel."""
