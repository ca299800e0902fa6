"""Running sessions as others see them: their rings, figures, rows and events, and requests to their daemons.

It only reads the rings, so no daemon waits for it. The live page, the bridges and the live ends build on it.
"""
