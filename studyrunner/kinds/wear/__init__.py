"""Wear histories."""
