"""How hypothesis draws its examples: always the same ones, and however slow the machine is."""

from __future__ import annotations

from hypothesis import HealthCheck, settings

# a failure has to be one that the next run shows, too; a busy machine is none
settings.register_profile(
    "tests", deadline=None, derandomize=True, database=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("tests")
