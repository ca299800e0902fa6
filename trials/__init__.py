"""Programs that judge WeberLink and are no tests: each takes minutes or more, and needs a machine to itself."""
