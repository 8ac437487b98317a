"""Study of safe foothold regions on all cores (`walk footholds`), and its files with their picture."""
