"""The paper's claims beside what is measured here.

The paper: X. Xu, J. Kammerl, R. Chaudhari, E. Steinbach, "Hybrid signal-based and geometry-based prediction for haptic
data reduction", IEEE International Workshop on Haptic Audio Visual Environments and Games (HAVE), 2011.
"""
