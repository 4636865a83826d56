"""What a run says of its results: worn volumes within rtol, certificates, outcomes, findings."""
