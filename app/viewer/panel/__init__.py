"""The panel beside the scene, one module for each tab."""
