"""Check for optional packages."""

from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path

from weberlink.installation import install_line
from weberlink.system.configuration.errors import ConfigurationError


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


def need_to_read(recordings: Iterable[Path], asked: str) -> None:
    """Require what reads recordings, once the files are there: a wrong name is the nearer mistake.

    Args:
        recordings: the files.
        asked: as of `need`.

    Raises:
        ConfigurationError: a file is not there, or the package is not installed.
    """
    for path in recordings:
        try:
            path.stat()
        except OSError as error:
            raise ConfigurationError(f"{path}: cannot be read: {error.strerror}; expected a recording") from None
    need("mcap", "recording", asked)
