"""What every route shares: schemas, refusals, guards of the port, the page and the proxy to viser."""
