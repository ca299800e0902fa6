"""The open relatives of the PHANTOM: WoodenHaptics, Polhem and the SensAble PHANTOM with new electronics."""
