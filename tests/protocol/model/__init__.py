"""Models of the protocol in Promela, and what runs them."""
