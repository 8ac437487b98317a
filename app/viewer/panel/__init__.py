"""Panel beside the scene: sliders, layers, parameters of the method, plots, and what runs here."""
