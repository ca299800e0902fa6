"""Counts of an independent implementation of the paper's hybrid for recordings of the study, in packets per second.

k = 0.10, floor 0.05 N, the measured force as reference, no wire steps. Where a fit is ill-conditioned (the sphere, and
any geometry in a field) the count depends on when a model is trusted.
"""

FLOOR_N = 0.05
HYBRID_PER_S = {
    "omega3_1": 54.9,
    "omega3_13": 40.9,
    "omega3_19": 23.3,
    "omega3_7": 31.6,
    "tue_foam_1": 21.0,
    "tue_foam_2": 47.2,
    "tue_free_1": 9.5,
    "tue_free_2": 7.2,
    "tue_rigid_1": 25.2,
    "tue_rigid_2": 27.3,
    "tue_spring_1": 12.2,
    "tue_spring_2": 18.0,
}
