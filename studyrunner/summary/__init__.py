"""What a run says of its results: worn volumes known to rtol, certificates, outcomes, findings."""
