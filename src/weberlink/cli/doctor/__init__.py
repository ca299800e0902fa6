"""The `doctor` command: check this machine for real-time problems and suggest fixes."""

from weberlink.cli.doctor import kernel as _kernel  # noqa: F401 - the first checks of the table
from weberlink.cli.doctor import network as _network  # noqa: F401 - and the others
