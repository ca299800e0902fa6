"""Arms that are led and followed joint by joint: the contract of both ends."""
