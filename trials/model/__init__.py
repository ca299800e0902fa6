"""Models of the protocol in Promela, and the program that runs them."""
