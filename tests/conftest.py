"""How hypothesis draws its examples: always the same ones, and however slow the machine is. One BLAS thread a process,
as on every rank: processes that share cores wait for the threads of each other.
"""

import os

from hypothesis import HealthCheck, settings

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    # before numpy is imported
    os.environ.setdefault(name, "1")

# a failure has to be one that the next run shows, too; a busy machine is none
settings.register_profile(
    "tests", deadline=None, derandomize=True, database=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("tests")


def pytest_xdist_auto_num_workers():
    """Of `-n auto`: one more than cores, as tests that start runs wait about as long as they compute."""
    return None if "PYTEST_XDIST_AUTO_NUM_WORKERS" in os.environ else len(os.sched_getaffinity(0)) + 1
