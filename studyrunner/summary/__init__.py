"""What came out of a study: `answer.summary` of an opened result, and `lines.summary_lines`, its text."""
