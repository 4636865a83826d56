"""What the operating system does: files, the process with its signals and streams, the machine, progress on stderr."""
