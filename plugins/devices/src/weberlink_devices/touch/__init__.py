"""The driver `touch`: 3D Systems Touch, Touch X and PHANTOM through the maker's library libHD.so."""
