"""`walk footholds`: the study of safe foothold regions on all cores, its figure and its files."""
