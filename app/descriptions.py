"""Descriptions of the fields of a dataclass, read from the text below each."""

import ast
import inspect
from functools import cache
from itertools import pairwise
from typing import cast


@cache
def descriptions(kind: type) -> dict[str, str]:
    """Text below each field of a dataclass."""
    (tree,) = ast.parse(inspect.getsource(kind)).body
    found: dict[str, str] = {}
    for pair in pairwise(cast(ast.ClassDef, tree).body):
        match pair:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                found[name] = text
            case _:
                pass
    return found
