"""Inspection: whether the registered part is accepted, check by check."""
