"""What the operating system does: files and their locks, streams, signals, faults of the machine."""
