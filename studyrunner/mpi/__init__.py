"""The ranks of a run: who computes what, and messages between them."""
