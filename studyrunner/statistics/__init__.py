"""What the samples of a result say."""
