"""Figures of studies with samples: what their scatter says of the worn volume."""
