"""The scene of a study: its reduced model, and what it can tell beside that."""
