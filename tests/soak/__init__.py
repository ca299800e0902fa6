"""Live sessions under every fault at once, for as long as one likes: `python -m tests.soak` (README.md beside it).

The tests beside it are of its parts, and one short run.
"""
