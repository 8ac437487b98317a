"""Schemas, refusals and guards that all routes share.

`schemas`, `run_schemas` and `scenario_schema` describe bodies of requests and responses, `live_json` writes the live
snapshot, and `refusals` gives every error one shape. `guards` and `token` stand before all routes; `page` serves what a
browser loads, viser's client included; `prometheus` writes the metrics.
"""
