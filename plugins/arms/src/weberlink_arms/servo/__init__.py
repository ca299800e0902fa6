"""What arms with servos on a bus share, whatever the protocol on its wire."""
