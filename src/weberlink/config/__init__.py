"""The YAML file that describes a whole system: what it may say, and how it is read."""

from weberlink.config.errors import ConfigurationError
from weberlink.config.loading import MASTER, SIDES, SLAVE, Configuration, load
from weberlink.config.model import System

__all__ = ["MASTER", "SIDES", "SLAVE", "Configuration", "ConfigurationError", "System", "load"]
