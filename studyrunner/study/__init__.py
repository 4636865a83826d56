"""The study: what a study file says, read, checked, frozen, and written again."""
