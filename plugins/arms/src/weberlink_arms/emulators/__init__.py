"""Emulated servos of arms, shared by the emulators of leaders and followers."""
