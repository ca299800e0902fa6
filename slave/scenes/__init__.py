"""Contact of one ideal point with solids: what the slave feels when no real robot touches a real object.

Pure geometry and mechanics: no clock, no files (except the height field a scene file names), no idea who asks.
"""
