"""Text files of finite-element codes: opened within limits, cut into keywords, data lines and numbers."""
