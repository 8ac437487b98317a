"""The paper's figures, and its claims beside what was measured in the very same walks."""

from app.figures.make import make_figures

__all__ = ["make_figures"]
