"""Programs around a session: monitor, doctor, device test, emulators, recordings."""
