"""Colours and vector drawings of walks, shared by figures, reports and exports."""
