"""Where a haptic loop stays calm: the sampled wall beside its analytic limits, and whole systems over a grid of cells.

`wall` is the loop on paper, `boundary` and `activity` measure the same loop built of the real hand and scene, `cells`
says which whole systems a map visits, and `verdict` judges their records. Composes no system: that is above.
"""
