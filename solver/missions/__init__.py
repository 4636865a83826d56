"""Missions: blocks of vibration in order, repeated thousands of times, and the wear of a joint over them."""
