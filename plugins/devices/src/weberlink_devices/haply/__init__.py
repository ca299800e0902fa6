"""The Haply 2DIY and its predecessor: a planar five-bar linkage on a serial board."""
