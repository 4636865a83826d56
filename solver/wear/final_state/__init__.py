"""The final state, in which nothing wears any more: computed directly by an active set, or by a wear history."""
