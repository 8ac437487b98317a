"""Sweeps: cells walked on all cores or a cluster, kept as they come, and told in tables, figures and a page.

`engine` hands cells to joblib, `cells` keeps their outcomes in a folder, `results` sums them up.
"""
