"""The open relatives of the PHANTOM: WoodenHaptics, Polhem and the SensAble PHANTOM with new electronics.

Owns their mechanics, their two wire formats and the two drivers. A mechanism knows no bytes, a format knows no
mechanism; they meet in the drivers.
"""
