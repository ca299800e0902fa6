"""Studies: each folder has a command, its figures and its document."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
"""The matrices here are small, and studies run in a process per processor: threads of BLAS only wait for each other."""
