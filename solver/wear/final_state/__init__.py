"""The state at which nothing wears any more: whether a march has come to it, or never will."""
