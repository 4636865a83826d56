"""Stiffness and mass that other codes wrote: readers of their files, and checks of what they hold."""
