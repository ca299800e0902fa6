"""Bilateral haptic teleoperation over UDP with perceptual coding; docs/library.md shows how to use it as a library.

Each name is imported on first use: `import weberlink` alone loads no other package.
"""

import os

TYPE_CHECKING = False
if TYPE_CHECKING:
    from weberlink.codec import Channel, Decoder, Encoder, force_channel, position_channel
    from weberlink.codec.choice import CHOICES, Choice
    from weberlink.codec.deadband import DEADBANDS, Deadband
    from weberlink.codec.predictors import PREDICTORS, EstimatedPredictor, FittedPredictor, Predictor
    from weberlink.codec.replay import Coded, code
    from weberlink.config import Configuration, ConfigurationError, load
    from weberlink.master.trace import Trace, read_trace
    from weberlink.protocol import Endpoint, LocalEnd, Role, UpdateLost, UpdateReceived
    from weberlink.protocol.psk import PresharedKey
    from weberlink.protocol.security import Checksum
    from weberlink.session.simulation import simulate
    from weberlink.update import ModelParameters, PreviousSample, Update, UpdateForm

    __version__: str

__all__ = [
    "CHOICES",
    "DEADBANDS",
    "PREDICTORS",
    "Channel",
    "Checksum",
    "Choice",
    "Coded",
    "Configuration",
    "ConfigurationError",
    "Deadband",
    "Decoder",
    "Encoder",
    "Endpoint",
    "EstimatedPredictor",
    "FittedPredictor",
    "LocalEnd",
    "ModelParameters",
    "Predictor",
    "PresharedKey",
    "PreviousSample",
    "Role",
    "Trace",
    "Update",
    "UpdateForm",
    "UpdateLost",
    "UpdateReceived",
    "__version__",
    "code",
    "force_channel",
    "load",
    "position_channel",
    "read_trace",
    "simulate",
]

_PLACES = {
    "weberlink.codec": "Channel Decoder Encoder force_channel position_channel",
    "weberlink.codec.choice": "CHOICES Choice",
    "weberlink.codec.deadband": "DEADBANDS Deadband",
    "weberlink.codec.predictors": "PREDICTORS EstimatedPredictor FittedPredictor Predictor",
    "weberlink.codec.replay": "Coded code",
    "weberlink.master.trace": "Trace read_trace",
    "weberlink.protocol": "Endpoint LocalEnd Role UpdateLost UpdateReceived",
    "weberlink.protocol.security": "Checksum",
    "weberlink.protocol.psk": "PresharedKey",
    "weberlink.config": "Configuration ConfigurationError load",
    "weberlink.session.simulation": "simulate",
    "weberlink.update": "ModelParameters PreviousSample Update UpdateForm",
}

if os.environ.get("WEBERLINK_PURE") == "1":
    import sys
    from importlib.machinery import SOURCE_SUFFIXES, FileFinder, SourceFileLoader

    def _find_source(folder: str) -> FileFinder:
        """A finder that passes over compiled modules, for the folders of this package."""
        if os.path.commonpath((folder, *__path__)) not in __path__:
            raise ImportError
        return FileFinder(folder, (SourceFileLoader, SOURCE_SUFFIXES))

    sys.path_hooks.insert(0, _find_source)


def __getattr__(name: str) -> object:
    if name == "__version__":
        from importlib.metadata import version  # noqa: PLC0415

        return version("weberlink")
    for module, names in _PLACES.items():
        if name in names.split():
            from importlib import import_module  # noqa: PLC0415

            value = globals()[name] = getattr(import_module(module), name)
            return value
    raise AttributeError(f"module 'weberlink' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
