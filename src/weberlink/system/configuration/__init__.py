"""The YAML file that describes a whole system: what it may say, and how it is read."""

from weberlink.system.configuration.errors import ConfigurationError
from weberlink.system.configuration.loading import MASTER, SIDES, SLAVE, Configuration, load
from weberlink.system.configuration.model import System

__all__ = ["MASTER", "SIDES", "SLAVE", "Configuration", "ConfigurationError", "System", "load"]
