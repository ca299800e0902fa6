"""Live sessions under every fault at once, for as long as one likes, and under floods: run by hand, not by the suite.

`python -m tests.soak` and `python -m tests.soak.flood`; docs/soak.md says what they do and how to read them. The tests
beside them are of their parts, and one short run of each.
"""
