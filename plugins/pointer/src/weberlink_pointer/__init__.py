"""The device `pointer`, and the targets with which a program of this host leads a hand or an arm."""
