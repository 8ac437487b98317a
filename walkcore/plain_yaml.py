"""Plain values from YAML and JSON: mappings, lists, text, numbers, true, false and null, within limits.

The limits are checked while the values are made, so that a file from anywhere costs no more than a second: a few
bytes of aliases would otherwise describe more values than the memory holds. JSON is read as the YAML that it is.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, cast

import yaml
from yaml.constructor import SafeConstructor
from yaml.resolver import Resolver

from walkcore.errors import InvalidValueError
from walkcore.values import check_text

MAX_BYTES = 4_000_000  # of a file
MAX_VALUES = 150_000  # values and keys, of whatever kind
MAX_NESTING = 16  # lists and mappings within each other; a scenario has five
MAX_TEXT = 1000  # characters of a text, a number or a key

TAG = "tag:yaml.org,2002:"
UNTAGGED = (None, "!")
PARSER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the same in C, where PyYAML was built with libyaml


def load_yaml(file: Path | Traversable, what: str) -> Any:
    """The plain values of a YAML or JSON file, in UTF-8 or UTF-16.

    Args:
        file: to be read.
        what: name of its content, with which the fields in messages begin.

    Raises:
        InvalidValueError: naming the field, its value and its limit.
        OSError: if the file cannot be read.
    """
    with file.open("rb") as stream:
        content = stream.read(MAX_BYTES + 1)
    return parse_yaml(content, what, str(file))


def parse_yaml(content: bytes, what: str, source: str) -> Any:
    """The plain values of a text in YAML or JSON, in UTF-8 or UTF-16.

    Args:
        content: to be read.
        what: name of it, with which the fields in messages begin.
        source: file that it came from, for messages.

    Raises:
        InvalidValueError: naming the field, its value and its limit.
    """
    if len(content) > MAX_BYTES:
        raise InvalidValueError(what, source, f"must be at most {MAX_BYTES} bytes")
    try:
        value = _Reader(content, what).document()
    except (yaml.YAMLError, ValueError) as error:
        if isinstance(error, InvalidValueError):
            raise
        raise InvalidValueError(what, source, f"is not YAML: {' '.join(str(error).split())}") from error
    check_size(what, value)  # again, as an alias stands for as many values as its anchor
    return value


def check_size(what: str, value: Any, max_values: int = MAX_VALUES) -> None:
    """Refuse values that could not be stored, shown in a message or walked through.

    Args:
        what: name of the values in messages.
        value: plain values, such as JSON gives.
        max_values: most values and keys that they may have.

    Raises:
        InvalidValueError: for values nested too deeply, too many of them, text too long or not Unicode.
    """
    level: list[Any] = [value]
    nb_values = 0
    for _ in range(MAX_NESTING + 1):
        if not level:
            return
        inner: list[Any] = []
        for item in level:
            items = _items(item)
            nb_values += len(items)
            if nb_values > max_values:
                raise InvalidValueError("number of values", nb_values, f"must be at most {max_values}")
            inner += items
        for text in (item for item in inner if isinstance(item, str)):
            _check_length("text", text)
            check_text("text", text)
        level = [item for item in inner if isinstance(item, Mapping | list)]
    raise InvalidValueError(what, "nested values", f"must not be nested more than {MAX_NESTING} deep")


def _items(value: Any) -> list[Any]:
    if isinstance(value, Mapping):
        mapping = cast(Mapping[Any, Any], value)
        return [*mapping.keys(), *mapping.values()]
    return cast(list[Any], value) if isinstance(value, list) else []


def _check_length(field: str, text: str) -> None:
    if len(text) > MAX_TEXT:
        raise InvalidValueError(field, text[:20] + "...", f"must be at most {MAX_TEXT} characters")


class _Scalars(Resolver, SafeConstructor):
    """Kind of a scalar without a tag, and its value, by PyYAML."""

    def __init__(self) -> None:
        Resolver.__init__(self)  # pyright: ignore[reportUnknownMemberType] (not in its stubs)
        SafeConstructor.__init__(self)
        makers = {"bool": self.construct_yaml_bool, "int": self.construct_yaml_int, "float": self.construct_yaml_float}
        self.makers = cast(dict[str, Callable[[yaml.ScalarNode], Any]], makers | {"null": self.construct_yaml_null})
        """Maker of a value, by the name of its tag; a value with another one is text, such as a date."""

    def kind(self, event: yaml.ScalarEvent) -> str:
        """Name of the tag of a scalar that has none written before it."""
        tag = self.resolve(yaml.ScalarNode, event.value, event.implicit)  # pyright: ignore[reportUnknownMemberType, reportUnknownVariableType] (not in its stubs)
        return str(tag).removeprefix(TAG)  # pyright: ignore[reportUnknownArgumentType]


# PyYAML follows YAML 1.1, for which 1e-6 is text; here it is a number, as in JSON.
_Scalars.add_implicit_resolver(  # pyright: ignore[reportUnknownMemberType] (not in its stubs)
    f"{TAG}float",
    re.compile(r"^[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$"),
    list("-+.0123456789"),
)


class _Reader:
    """Makes plain values of the events of PyYAML's parser."""

    def __init__(self, content: bytes, what: str) -> None:
        self._events: Iterator[yaml.Event] = yaml.parse(content, Loader=PARSER)  # pyright: ignore[reportUnknownMemberType] (not in its stubs)
        self._what = what
        self._scalars = _Scalars()
        self._anchors: dict[str, Any] = {}
        self._nb_values = 0

    def document(self) -> Any:
        """The value of the only document; None of an empty one."""
        next(self._events)  # the stream begins
        if isinstance(next(self._events), yaml.StreamEndEvent):
            return None
        value = self._value(next(self._events), "", 0)
        next(self._events)  # the document ends
        if not isinstance(next(self._events), yaml.StreamEndEvent):
            raise self._refused("", "several documents", "must be one")
        return value

    def _value(self, event: yaml.Event, where: str, depth: int) -> Any:
        self._count()
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in self._anchors:  # a value that contains itself is not known yet, either
                raise self._refused(where, f"*{event.anchor}", "must be the name of an anchor before it")
            return self._anchors[event.anchor]
        if isinstance(event, yaml.ScalarEvent):
            value = self._scalar(event, where)
        elif depth == MAX_NESTING:
            raise self._refused(where, "nested values", f"must not be nested more than {MAX_NESTING} deep")
        elif isinstance(event, yaml.SequenceStartEvent):
            self._check_tag(where, event.tag, "seq")
            value = self._list(where, depth + 1)
        else:
            assert isinstance(event, yaml.MappingStartEvent)
            self._check_tag(where, event.tag, "map")
            value = self._mapping(where, depth + 1)
        if event.anchor is not None:
            self._anchors[event.anchor] = value
        return value

    def _list(self, where: str, depth: int) -> list[Any]:
        values: list[Any] = []
        while not isinstance(event := next(self._events), yaml.SequenceEndEvent):
            values.append(self._value(event, f"{where}[{len(values)}]", depth))
        return values

    def _mapping(self, where: str, depth: int) -> dict[str, Any]:
        values: dict[str, Any] = {}
        while not isinstance(event := next(self._events), yaml.MappingEndEvent):
            if not isinstance(event, yaml.ScalarEvent):
                raise self._refused(where, "a list, mapping or alias", "must have text for keys")
            key = event.value
            self._count()
            _check_length("key", key)
            inside = f"{where}.{key}" if where else key
            if key in values:
                raise self._refused(inside, key, "is given twice")
            values[key] = self._value(next(self._events), inside, depth)
        return values

    def _scalar(self, event: yaml.ScalarEvent, where: str) -> Any:
        _check_length(where or self._what, event.value)
        makers = self._scalars.makers
        self._check_tag(where, event.tag, "str", *makers)
        kind = self._scalars.kind(event) if event.tag in UNTAGGED else event.tag.removeprefix(TAG)
        if kind not in makers:
            return event.value
        try:
            return makers[kind](yaml.ScalarNode(TAG + kind, event.value))
        except (ValueError, LookupError) as error:
            raise self._refused(where, event.value, f"must be of the type {kind}, as its tag says") from error

    def _count(self) -> None:
        self._nb_values += 1
        if self._nb_values > MAX_VALUES:
            raise InvalidValueError("number of values", self._nb_values, f"must be at most {MAX_VALUES}")

    def _check_tag(self, where: str, tag: str | None, *known: str) -> None:
        if tag not in UNTAGGED and tag not in (f"{TAG}{name}" for name in known):
            raise self._refused(where, tag, f"must have no tag but {', '.join(f'!!{name}' for name in known)}")

    def _refused(self, where: str, value: Any, limit: str) -> InvalidValueError:
        return InvalidValueError(where or self._what, value, limit)
