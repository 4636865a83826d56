"""What came out of a study: `answer.summary` of an opened result, made of `findings`."""
