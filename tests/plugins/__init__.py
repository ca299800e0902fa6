"""The plugins of other programs: what of them runs without these programs, and trials with them."""
