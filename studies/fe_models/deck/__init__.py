"""Meshes with their sets, surfaces and steps: decks of CalculiX and Abaqus, and meshes of other programs."""
