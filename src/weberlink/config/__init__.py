"""The YAML file that describes a whole system: what it may say, and how it is read."""

from weberlink.config.errors import ConfigurationError
from weberlink.config.loading import Configuration, load
from weberlink.config.model import System
from weberlink.order import MASTER, SIDES, SLAVE

__all__ = ["MASTER", "SIDES", "SLAVE", "Configuration", "ConfigurationError", "System", "load"]
