import pytest

for guest in ("studies", "doctor"):
    pytest.importorskip(f"weberlink_{guest}", reason="the benchmarks use tables of studies, checks of doctor")
