"""Feetech STS3215 servos on their bus, as the SO-101 leader and follower arms have them."""
