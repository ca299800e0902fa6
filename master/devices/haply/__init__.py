"""The Haply 2DIY and its forerunner: a planar five-bar linkage on a serial board. Knows no scene and no network."""
