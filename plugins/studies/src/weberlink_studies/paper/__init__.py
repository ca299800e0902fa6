"""The claims of the paper beside measurements.

The paper: X. Xu, J. Kammerl, R. Chaudhari, E. Steinbach, "Hybrid signal-based and geometry-based prediction for haptic
data reduction", IEEE International Workshop on Haptic Audio Visual Environments and Games (HAVE), 2011.
"""
