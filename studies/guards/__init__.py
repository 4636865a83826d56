"""Checks of files of unknown origin, and of the places of modules, before anything is read or loaded."""
