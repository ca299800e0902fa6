"""The composition of everything: how a configuration becomes the two sides and the link between them.

`link` makes what both sides share, `master` and `slave` one side each; a daemon imports its own. Knows the parts and
their constructors, and owns no behaviour.
"""
