"""Parts of a JSON schema: values, their descriptions and their limits."""

from collections.abc import Sequence
from typing import Any

Json = dict[str, Any]


def mapping(description: str, required: Sequence[str] = (), /, **properties: Json) -> Json:
    """A mapping with these keys, some of them required, and no others."""
    return {
        "type": "object",
        "description": description,
        "properties": properties,
        "required": list(required),
        "additionalProperties": False,
    }


def number(description: str = "", low: float | None = None, high: float | None = None, **more: Any) -> Json:
    """A number within limits, where it has some."""
    limits = {"minimum": low, "maximum": high}
    described = {"description": description} if description else {}
    return {"type": "number"} | described | {key: limit for key, limit in limits.items() if limit is not None} | more


def whole(description: str, low: float, high: float, **more: Any) -> Json:
    """A whole number within limits."""
    return number(description, low, high, **more) | {"type": "integer"}


def text(description: str, **more: Any) -> Json:
    """Text."""
    return {"type": "string", "description": description} | more


def choice(description: str, choices: Sequence[str], **more: Any) -> Json:
    """One of some texts."""
    return {"enum": list(choices), "description": description} | more


def list_of(items: Json, description: str = "", low: int | None = None, high: int | None = None) -> Json:
    """A list of items of one kind, of a length within limits, where it has some."""
    lengths = {key: length for key, length in (("minItems", low), ("maxItems", high)) if length is not None}
    return {"type": "array", "items": items} | lengths | ({"description": description} if description else {})


def optional(schema: Json) -> Json:
    """A value that may also be null, which is as good as missing."""
    return schema | {"type": [schema["type"], "null"]}


def complete(description: str, /, **members: Json) -> Json:
    """A mapping with these keys, all of them required, and no others."""
    return mapping(description, tuple(members), **members)
