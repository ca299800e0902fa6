"""Optional packages: whether one is there, and the line that says how to get it."""

from importlib.util import find_spec

from weberlink.system.configuration.errors import ConfigurationError


def need(package: str, extra: str, asked: str) -> None:
    """Make sure of a package before anything is computed.

    Args:
        package: as it is imported.
        extra: of this project that brings it.
        asked: what asks for it, as the user wrote it.

    Raises:
        ConfigurationError: it is not installed.
    """
    if find_spec(package) is None:
        raise ConfigurationError(f'{asked}: needs {package}; install it with: pip install "weberlink[{extra}]"')
