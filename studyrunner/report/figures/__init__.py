"""The figures of a result, one file a subject."""
