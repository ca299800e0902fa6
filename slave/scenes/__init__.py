"""Contact of one ideal point with solids: what the slave feels when no real robot touches a real object."""
