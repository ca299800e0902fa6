"""The Haply Inverse3 through the WebSocket of its service."""
