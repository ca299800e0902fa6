"""Tests that a build compiled with mypyc cannot run."""

import pytest

from weberlink.compiled import is_compiled

COMPILED = "weberlink__mypyc"  # the module that holds what was compiled
replaces_methods = pytest.mark.skipif(is_compiled(), reason="compiled classes: their methods cannot be replaced")
