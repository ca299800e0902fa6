import pytest

pytest.importorskip("weberlink_studies", reason="the benchmarks use the tables of weberlink-studies")
