"""A missing optional package is one line that says how to get it."""

import pytest

from weberlink.system.configuration import ConfigurationError
from weberlink.system.extras import need


def test_a_missing_package_is_named_with_the_line_that_installs_it() -> None:
    with pytest.raises(ConfigurationError) as caught:
        need("no_such_package", "plots", "--plots")
    assert str(caught.value) == '--plots: needs no_such_package; install it with: pip install "weberlink[plots]"'


def test_a_package_that_is_there_is_no_matter() -> None:
    need("numpy", "plots", "--plots")
