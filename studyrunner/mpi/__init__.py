"""The ranks of a run: who computes what, messages between them, and what is written when a rank dies (`crashes`)."""
