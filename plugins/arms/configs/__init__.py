"""Sessions of arms, and the udev rules of their adapters."""

OTHERS = {"49-weberlink-arms.rules": "udev rules of the arms; weberlink device rules installs them"}
