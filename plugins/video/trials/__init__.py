"""How old pictures are on the operator's page, and the force beside them."""
