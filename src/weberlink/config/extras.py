"""Check for optional packages."""

from importlib.util import find_spec

from weberlink.config.errors import ConfigurationError
from weberlink.installation import install_line


def need(package: str, extra: str, asked: str) -> None:
    """Require a package.

    Args:
        package: import name.
        extra: extra of this project that installs it.
        asked: the option or key that needs it, as the user wrote it.

    Raises:
        ConfigurationError: it is not installed.
    """
    if find_spec(package) is None:
        raise ConfigurationError(f"{asked}: needs {package}; install it with: {install_line(extra)}")
