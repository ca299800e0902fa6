"""The udev rules."""

OTHERS = {"49-weberlink-devices.rules": "udev rules of the devices; weberlink device rules installs them"}
