"""Missions: blocks of vibration in order, flown thousands of times, and the wear of a joint over them."""
