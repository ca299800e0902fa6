"""Devices of Force Dimension, and the Novint Falcon, through the maker's library."""
