"""Files from anywhere: each is read, or refused in one line with its field, its value and its limit."""

import json

import pytest
import yaml
from conftest import walk
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from walkcore import WalkError, load_robot, load_scenario
from walkcore.analysis.sweep import load_sweep
from walkcore.errors import InvalidValueError, UnknownNameError
from walkcore.plain_yaml import MAX_BYTES, MAX_NESTING, MAX_TEXT, MAX_VALUES, load_yaml
from walkcore.scenario.lesson import load_lesson
from walkcore.scenario.scenario import MAX_EVENTS

LEAST = "robot: hrp2\nduration: 1.0\n"
LAUGHS = "a0: &a0 [x, x]\n" + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 12))
MERGES = "m0: &m0 {a: 1}\n" + "".join(f"m{i}: &m{i}\n  <<: [{', '.join([f'*m{i - 1}'] * 9)}]\n" for i in range(1, 9))
HOSTILE = {
    "solver is a list": (LEAST + "parameters: {solver: []}", "parameters.solver"),
    "scheme is a mapping": (LEAST + "parameters: {scheme: {}}", "parameters.scheme"),
    "event is a list": (LEAST + "events: [[]]", "events[0]"),
    "event is nothing": (LEAST + "events:\n-\n-", "events[0]"),
    "no bool": ("duration: !!bool abc", "duration"),
    "no float": ("duration: !!float ''", "duration"),
    "no int": (LEAST + "parameters: {horizon_samples: !!int ''}", "parameters.horizon_samples"),
    "no timestamp": ("duration: !!timestamp abc", "duration"),
    "no binary": ("name: !!binary '%'", "name"),
    "a date": ("duration: 2026-13-45", "duration"),
    "a set": ("events: !!set {a, b}", "events"),
    "pairs": ("events: !!pairs [a: b]", "events"),
    "a type of Python": ("!!python/object/apply:os.getcwd []", "scenario"),
    "an unknown tag": ("name: !surprise x", "name"),
    "100,000 digits": ("duration: 1" + "0" * 100_000, "duration"),
    "900 digits": ("duration: 1" + "0" * 900, "duration"),
    "100,000 hexadecimal digits": ("duration: 0x" + "f" * 100_000, "duration"),
    "a long exponent": ("duration: 1e" + "9" * 900, "duration"),
    "a long text": ("name: " + "x" * 100_000, "name"),
    "a long key": ("x" * 100_000 + ": 1", "scenario"),
    "a long key with a question mark": ("? " + "x" * 100_000 + "\n: 1", "key"),
    "infinity": ("duration: .inf", "duration"),
    "not a number": ("duration: .nan", "duration"),
    "a bomb of aliases": (LAUGHS, "number of values"),
    "a bomb of merges": (MERGES, "number of values"),
    "a merge": ("a: &a {duration: 1.0}\n<<: *a", "scenario.a"),
    "a list in itself": ("events: &a [*a]", "events[0]"),
    "a mapping in itself": ("&a {events: *a}", "events"),
    "an alias of nothing": ("duration: *nothing", "duration"),
    "an alias as a key": ("name: &a x\n*a : 1", "scenario"),
    "a list as a key": ("? [a]\n: 1", "scenario"),
    "a key twice": ("duration: 1.0\nduration: 2.0", "duration"),
    "100,000 events": (LEAST + "events:\n" + "- {t: 0.5}\n" * 100_000, "number of values"),
    "a few events too many": (LEAST + "events:\n" + "- t: 0.5\n" * (MAX_EVENTS + 1), "events"),
    "100,000 lists": ("[" * 100_000, "[0]" * 16),
    "100,000 mappings": ("{a: " * 100_000, ".".join("a" * 16)),
    "100,000 indents": ("- " * 100_000, "[0]" * 16),
    "many lists": ("a: [" + "[]," * MAX_VALUES + "]", "number of values"),
    "a huge file": ("# " + "x" * MAX_BYTES, "scenario"),
    "two documents": ("duration: 1.0\n---\nduration: 2.0", "scenario"),
    "unclosed": ("{unclosed: [", "scenario"),
    "a tab": ("events:\n\t- t: 0", "scenario"),
    "nothing": ("", "scenario"),
    "a text": ("walk", "scenario"),
    "control characters in a key": ('"\\e[2J\\n": 1', "scenario.\\x1b[2J\\n"),
    "control characters in a robot": ('robot: "\\e[2J\\n"\nduration: 1', "no robot '\\x1b[2J\\n'"),
    "a surrogate": ('name: "\\ud800"\nduration: 1', "scenario"),
    "bytes": (b"\x00\xff\xfe" * 100, "scenario"),
    "a picture": (b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 100, "scenario"),
    "half of UTF-16": ("duration: 1".encode("utf-16")[:-1], "scenario"),
    "a byte-order mark only": (b"\xff\xfe", "scenario"),
    "Latin": ("name: möbius".encode("latin-1"), "scenario"),
}


@pytest.mark.parametrize(("content", "field"), HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_file_is_one_line_with_its_field_and_exit_code_two(tmp_path, content, field):
    file = tmp_path / "scenario.yaml"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    said = walk("run", file, "--out", tmp_path / "out")
    (line,) = said.stderr.splitlines()
    assert said.returncode == 2 and said.stdout == ""
    reason = line.removeprefix("walk: ").removeprefix(f"{file}: ")
    assert reason.startswith((f"{field} = ", f"{field};")) and line.isprintable() and len(line) < 2000
    assert not (tmp_path / "out").exists()


def test_every_file_that_is_wrong_is_named_and_nothing_runs(tmp_path):
    for name in ("one", "two"):
        (tmp_path / f"{name}.yaml").write_text("duration: -1")
    said = walk("run", tmp_path / "one.yaml", "circle", tmp_path / "two.yaml", "--out", tmp_path / "out")
    assert said.returncode == 2 and not (tmp_path / "out").exists()
    assert [line.partition(": duration = -1: ")[0] for line in said.stderr.splitlines()] == [
        f"walk: {tmp_path}/{name}.yaml" for name in ("one", "two")
    ]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_every_encoding_of_yaml_is_read_alike(tmp_path, encoding, newline):
    mark = {"utf-16-le": "\ufeff", "utf-16-be": "\ufeff"}.get(encoding, "")
    text = f"name: möbius\n{LEAST}events:\n- t: 0.5\n"
    file = tmp_path / "scenario.yaml"
    file.write_bytes((mark + text).replace("\n", newline).encode(encoding))
    scenario = load_scenario(file)
    assert (scenario.name, scenario.duration, len(scenario.events)) == ("möbius", 1.0, 1)


def test_values_are_plain_and_aliases_stand_for_them(tmp_path):
    file = tmp_path / "values.yaml"
    file.write_text("""
a: &a [1, 1.5, 1e-6, 0x10, true, null, ~, text, "1", '1', 2026-01-01, 12:30:00]
b: *a
c: {1: 2, yes: no, !!str 1.0: !!float 1}
d: !!str 5
""")
    a = [1, 1.5, 1e-6, 16, True, None, None, "text", "1", "1", "2026-01-01", 45000]
    c = {"1": 2, "yes": False, "1.0": 1.0}
    assert load_yaml(file, "values") == {"a": a, "b": a, "c": c, "d": "5"}


@pytest.mark.parametrize(
    ("text", "is_read"),
    [
        ("[" * MAX_NESTING + "]" * MAX_NESTING, True),
        ("[" * (MAX_NESTING + 1) + "]" * (MAX_NESTING + 1), False),
        ("x" * MAX_TEXT, True),
        ("x" * (MAX_TEXT + 1), False),
        ("a: &a [[[[[[[[[[]]]]]]]]]]\nb: [[[[[[[*a]]]]]]]", False),
    ],
)
def test_the_limits_are_what_they_say(tmp_path, text, is_read):
    file = tmp_path / "values.yaml"
    file.write_text(text)
    if is_read:
        load_yaml(file, "values")
    else:
        with pytest.raises(InvalidValueError):
            load_yaml(file, "values")


# By hypothesis

FUZZ = settings(max_examples=100, suppress_health_check=list(HealthCheck), derandomize=True)
KEYS = ("name", "robot", "duration", "parameters", "initial_state", "events", "expect", "t", "push", "impulse")
YAML_TEXT = st.lists(
    st.sampled_from(
        [*"[]{},:?!&*#|>-'\"%@` \n\t", "!!", "&a ", "*a ", "- ", ": ", "\n  ", "---\n", "...", "<<: ", "\\"]
    )
    | st.sampled_from(["1e5", "!!int ", "!!float ", "!!null ", "0x", "1:2", ".nan", "=", "~", "\ufeff", "\r\n", *KEYS])
    | st.characters(),
    max_size=30,
).map("".join)
PLAIN = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=8)
    | st.dates()
    | st.binary(max_size=8)
    | st.just(10**4000),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(KEYS) | st.text(), inner, max_size=4),
    max_leaves=8,
)


def assert_read_or_refused(file):
    try:
        load_scenario(file)
    except WalkError as error:
        line = f"{error}"
        assert line.isprintable() and len(line) < 2000, line


@FUZZ
@given(content=YAML_TEXT.map(lambda text: text.encode(errors="replace")) | st.binary(max_size=100))
@example(b"duration: !!float '")
def test_any_text_is_read_or_refused_in_one_line(tmp_path, content):
    file = tmp_path / "scenario.yaml"
    file.write_bytes(content)
    assert_read_or_refused(file)


@FUZZ
@given(
    where=st.sampled_from(
        [("name",), ("robot",), ("duration",), ("parameters",), ("initial_state",), ("expect",), ("events",), ("more",)]
        + [("parameters", key) for key in ("scheme", "solver", "horizon_samples", "com_height", "dynamic_filter")]
        + [("events", 0, key) for key in ("t", "reference", "over", "push", "parameters")]
        + [("events", 0, "push", key) for key in ("impulse", "duration", "frame")]
    ),
    value=PLAIN,
)
def test_any_value_anywhere_in_a_scenario_is_read_or_refused_in_one_line(tmp_path, where, value):
    scenario = {
        "robot": "hrp2",
        "duration": 1.0,
        "parameters": {},
        "events": [{"t": 0.5, "reference": {"vx": 0.1}, "push": {"impulse": [1.0, 0.0]}}],
    }
    inner = scenario
    for key in where[:-1]:
        inner = inner[key]
    inner[where[-1]] = value
    file = tmp_path / "scenario.yaml"
    for text in (yaml.safe_dump(scenario, allow_unicode=True), json.dumps(scenario, default=str)):
        file.write_bytes(text.encode(errors="replace"))
        assert_read_or_refused(file)


@pytest.mark.parametrize("load", [load_robot, load_scenario, load_sweep, load_lesson])
@pytest.mark.parametrize("name", ["nothing", "no/such/file.yaml", "x" * 5000, "\0", "a\0b", ""])
def test_a_name_that_is_none_is_refused_even_where_it_can_be_no_path(load, name):
    with pytest.raises(UnknownNameError):
        load(name)
