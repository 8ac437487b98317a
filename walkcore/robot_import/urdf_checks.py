"""Faults of a URDF file that its parser refuses or passes over, each named with its element and what to do.

The parser of Pinocchio tells them on several lines of the process's error stream, where a caller cannot read them, and
takes a link whose mass is no number for one without mass.
"""

import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from walkcore.errors import InvalidValueError

LIMITED = ("revolute", "prismatic")
KINDS = (*LIMITED, "continuous", "fixed", "floating", "planar")
NUMBERS = (  # element below a link or joint, attribute, how many numbers
    ("inertial/mass", "value", 1),
    *(("inertial/inertia", name, 1) for name in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")),
    *((f"{of}origin", name, 3) for of in ("inertial/", "") for name in ("xyz", "rpy")),
    ("axis", "xyz", 3),
    *(("limit", name, 1) for name in ("lower", "upper", "effort", "velocity")),
)
SHAPES = (  # of each shape of a link, in the same way
    *(("origin", name, 3) for name in ("xyz", "rpy")),
    ("geometry/box", "size", 3),
    *((f"geometry/{kind}", "radius", 1) for kind in ("sphere", "cylinder", "capsule")),
    *((f"geometry/{kind}", "length", 1) for kind in ("cylinder", "capsule")),
    ("geometry/mesh", "scale", 3),
)


def check_urdf(urdf: Path) -> None:
    """Refuse a file that is no URDF of one robot with masses.

    Args:
        urdf: file.

    Raises:
        InvalidValueError: naming the element, its value, and what it must be.
    """
    try:
        robot = ElementTree.fromstring(urdf.read_bytes())
    except ElementTree.ParseError as error:
        raise InvalidValueError("urdf", urdf.name, f"must be a URDF, which is XML: {error}") from error
    if robot.tag != "robot":
        raise InvalidValueError("urdf", f"<{robot.tag}>", "must be a URDF, whose root is <robot>")
    if not robot.get("name"):
        raise InvalidValueError("urdf", "<robot>", 'must have a name: <robot name="my-robot">')
    values = (value for element in robot.iter() for value in (element.tag, *element.attrib.values()))
    if any("ros.org/xacro" in value or "$(" in value or "${" in value for value in values):
        raise InvalidValueError("urdf", urdf.name, "must be expanded first: xacro robot.urdf.xacro > robot.urdf")
    links, joints = robot.findall("link"), robot.findall("joint")
    for kind, elements in (("link", links), ("joint", joints)):
        _check_names(kind, elements)
        for element in elements:
            where = f"urdf.{kind}.{element.get('name')}"
            _check_numbers(where, element, NUMBERS)
            for shape in (*element.findall("visual"), *element.findall("collision")):
                _check_numbers(f"{where}.{shape.tag}", shape, SHAPES)
                if not len(shape.find("geometry") or ()):
                    limit = "must have a <geometry> with a box, cylinder, sphere or mesh: add one, or take it out"
                    raise InvalidValueError(f"{where}.{shape.tag}", "nothing to see", limit)
    for joint in joints:
        _check_joint(joint, {link.get("name", "") for link in links})
    _check_tree([link.get("name", "") for link in links], joints)
    if not any(_masses(links)):
        raise InvalidValueError("urdf", urdf.name, "must give its links masses: each needs an <inertial>")


def _check_names(kind: str, elements: list[Element]) -> None:
    if kind == "link" and not elements:
        raise InvalidValueError("urdf", "no link", "must have links, and joints that move them")
    for name, count in Counter(element.get("name") for element in elements).items():
        if name is None or count > 1:
            raise InvalidValueError(f"urdf.{kind}", name, f"must be the name of one {kind}, not of {count}")


def _check_numbers(where: str, element: Element, numbers: tuple[tuple[str, str, int], ...]) -> None:
    for path, name, count in numbers:
        text = None if (found := element.find(path)) is None else found.get(name)
        if text is None:
            continue
        try:
            given = [float(word) for word in text.split()]
        except ValueError:
            given = []
        if len(given) != count or not all(map(math.isfinite, given)):
            wanted = "a number" if count == 1 else f"{count} numbers"
            raise InvalidValueError(f"{where}.{path.replace('/', '.')}.{name}", text, f"must be {wanted}")
    if any(mass < 0.0 for mass in _masses([element])):
        raise InvalidValueError(f"{where}.inertial.mass", next(_masses([element])), "must not be negative [kg]")


def _masses(links: list[Element]) -> Iterator[float]:
    for link in links:
        if (mass := link.find("inertial/mass")) is not None:
            yield float(mass.get("value", "0"))


def _check_joint(joint: Element, links: set[str]) -> None:
    where = f"urdf.joint.{joint.get('name')}"
    for end in ("parent", "child"):
        name = _end(joint, end)
        if name not in links:
            raise InvalidValueError(f"{where}.{end}", name, "must be a link of the URDF: name it right, or add it")
    kind, limits, axis = joint.get("type"), joint.find("limit"), joint.find("axis")
    if kind not in KINDS:
        raise InvalidValueError(f"{where}.type", kind, f"must be one of {', '.join(KINDS)}")
    if kind == "floating":
        limit = f"must not be there: the base floats here already; take out {_end(joint, 'parent')} and this joint"
        raise InvalidValueError(f"{where}.type", kind, limit)
    if kind in LIMITED and limits is None:
        limit = 'must have a <limit lower="..." upper="..." effort="..." velocity="..."/>'
        raise InvalidValueError(where, kind, limit)
    if limits is not None and (lower := float(limits.get("lower", 0))) > (upper := float(limits.get("upper", 0))):
        raise InvalidValueError(f"{where}.limit.lower", lower, f"must not be above its upper, {upper:g}: swap them")
    if axis is not None and kind != "fixed" and not any(map(float, axis.get("xyz", "1 0 0").split())):
        raise InvalidValueError(f"{where}.axis.xyz", axis.get("xyz"), "must have a direction, such as 0 1 0")


def _end(joint: Element, end: str) -> str | None:
    found = joint.find(end)
    return None if found is None else found.get("link")


def _check_tree(links: list[str], joints: list[Element]) -> None:
    """One link that no joint moves, and from there a single way to each other one."""
    moved = Counter(_end(joint, "child") for joint in joints)
    for name, count in moved.items():
        if count > 1:
            raise InvalidValueError(f"urdf.link.{name}", f"{count} joints", "must be the child of one: no loops here")
    roots = [name for name in links if name not in moved]
    if len(roots) > 1:
        limit = "must be one: joints must connect all links in one tree"
        raise InvalidValueError("urdf: links that no joint moves", ", ".join(roots[:4]), limit)
    reached: set[str | None] = set(roots)
    for _ in links:
        reached |= {_end(joint, "child") for joint in joints if _end(joint, "parent") in reached}
    unreached = [name for name in links if name not in reached]
    if unreached:
        limit = "must be connected to the others by a tree of joints, without a loop"
        raise InvalidValueError("urdf: links", ", ".join(unreached[:4]), limit)
