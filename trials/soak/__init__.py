"""Live sessions under every fault, one after the other: `python -m trials.soak` (README.md beside it)."""
