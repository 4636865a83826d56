"""What files of unknown origin may hold, and where modules may come from: checks before anything is read or loaded."""
