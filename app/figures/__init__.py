"""The paper's figures, and its claims beside what was measured in the very same walks (`walk figures`).

`walks` simulates, `measures` reads the recordings, `claims` compares, `drawing` draws, and `make` puts it together.
"""

from app.figures.make import make_figures

__all__ = ["make_figures"]
