"""Closed forms of textbook cases: vibration with dry friction, contact of curved bodies, wear to the end."""
