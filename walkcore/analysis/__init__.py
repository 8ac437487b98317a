"""Metrics of a walk, computed from the columns of its recording."""
