"""Robot files: YAML by the name of a robot that ships, or by a path, checked field by field."""

from collections.abc import Iterator, Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

from walkcore.errors import EmptyRegionError, InvalidValueError
from walkcore.mpc.regions import half_planes
from walkcore.named_files import is_file, named_file, shipped_files
from walkcore.parameters import Parameters
from walkcore.plain_yaml import load_yaml
from walkcore.robot import BodyModel, FixedFrame, FootholdRegion, ReplacedLimits, Robot, SwingMoments
from walkcore.values import (
    Matrix,
    check_complete,
    check_keys,
    check_list,
    check_mapping,
    check_range,
    check_text,
    check_vector,
    frozen_copy,
)

DEFAULT_ROBOT = "talos"
"""Robot that walks where none is named, and from whose size an import guesses what it cannot measure."""
REQUIRED = (
    *("name", "mass", "com_height", "stance_width", "sole", "foothold_regions", "max_foot_speed"),
    *("max_foot_yaw_rate", "max_com_distance", "max_reference", "max_push"),
)
OPTIONAL = ("title", "gait", "tipping_margin", "swing_moments", "body")
TIPPING_MARGIN = 0.015  # [m], of the default robot
GAIT = (
    *("step_duration", "initial_double_support_duration", "sampling_period", "double_support_duration"),
    *("cop_margin", "swing_height", "step_timing"),
)
"""Parameters that a robot may have a value of its own for."""
BODY_REQUIRED = ("urdf", "left_sole", "right_sole", "torso")
BODY_OPTIONAL = (
    *("package", "folder", "package_folder", "srdf", "posture", "posture_angles", "fixed_joints"),
    "replaced_limits",
)
# Lowest and highest value of each number, in the unit of `Robot`.
LIMITS: Mapping[str, tuple[float, float]] = {
    "mass": (0.1, 1000.0),
    "com_height": (0.05, 3.0),
    "stance_width": (0.01, 1.0),
    "max_foot_yaw_rate": (0.01, 20.0),
    "max_com_distance": (0.02, 3.0),
    "max_push": (0.1, 2000.0),
}
FASTEST = 20.0  # [m/s] of a foot, and [m/s] or [rad/s] of a reference
LARGEST = 3.0  # [m] of a sole or a foothold region, from its frame
MAX_CORNERS = 64
MAX_BANDS = 32
MAX_JOINTS = 200
# Of a joint: [rad/s], [N m].
JOINT_LIMITS: Mapping[str, tuple[float, float]] = {"velocity": (0.01, 100.0), "effort": (0.01, 10000.0)}


def robot_names() -> list[str]:
    """Names of the robots that ship."""
    return list(shipped_files("robots"))


def load_robot(name_or_path: str | Path = DEFAULT_ROBOT) -> Robot:
    """A robot.

    Args:
        name_or_path: name of one that ships, or path of a robot file.

    Raises:
        InvalidValueError: naming the field, its value and its limit.
        UnknownNameError: if there is none.
    """
    shipped = shipped_files("robots")
    if str(name_or_path) in shipped:
        return _shipped(str(name_or_path))
    file = named_file("robot", name_or_path, shipped)
    return robot_from_mapping(load_yaml(file, "robot"), Path(str(file)))


@cache
def _shipped(name: str) -> Robot:
    file = shipped_files("robots")[name]
    return robot_from_mapping(load_yaml(file, "robot"), Path(str(file)), source=name)


def robot_from_mapping(data: Any, file: Path, source: str | None = None) -> Robot:
    """A robot from the plain values of its file.

    Args:
        data: as YAML gives it.
        file: that they come from; paths in it start in its folder.
        source: name or path that `load_robot` takes; the file by default.

    Raises:
        InvalidValueError: naming the field, its value and its limit.
    """
    values = check_complete("robot", dict.fromkeys(OPTIONAL) | check_mapping("robot", data), (*REQUIRED, *OPTIONAL))
    name = check_text("robot.name", values["name"])
    if not name.replace("-", "").replace("_", "").isalnum():
        raise InvalidValueError("robot.name", name, "must be letters, digits, - and _")
    numbers = {key: check_range(f"robot.{key}", values[key], low, high) for key, (low, high) in LIMITS.items()}
    title, moments, tipping = (values[key] for key in ("title", "swing_moments", "tipping_margin"))
    tipping = TIPPING_MARGIN if tipping is None else tipping
    return Robot(
        name=name,
        title=name.capitalize() if title is None else check_text("robot.title", title),
        source=str(file.resolve()) if source is None else source,
        sole=_polygon("robot.sole", values["sole"]),
        foothold_regions=_regions(values["foothold_regions"]),
        max_foot_speed=check_vector("robot.max_foot_speed", values["max_foot_speed"], 2, 0.01, FASTEST),
        max_reference=_max_reference(values["max_reference"]),
        tipping_margin=check_range("robot.tipping_margin", tipping, 0.0, 0.1),
        swing_moments=_swing_moments({"foot": 0.0, "knee": 0.0, "com": 0.0} if moments is None else moments),
        parameters=_parameters({} if values["gait"] is None else values["gait"]),
        body=None if values["body"] is None else _body(values["body"], file.parent),
        **numbers,
    )


def _polygon(where: str, data: Any) -> Matrix:
    corners = check_list(where, data, MAX_CORNERS)
    vertices = frozen_copy([check_vector(f"{where}[{i}]", p, 2, -LARGEST, LARGEST) for i, p in enumerate(corners)])
    try:
        half_planes(vertices)
    except EmptyRegionError as error:
        raise InvalidValueError(where, data, "must be corners [x, y] that enclose an area") from error
    return vertices


def _regions(data: Any) -> tuple[FootholdRegion, ...]:
    where = "robot.foothold_regions"
    regions: list[FootholdRegion] = []
    for i, item in enumerate(check_list(where, data, MAX_BANDS)):
        band = check_complete(f"{where}[{i}]", item, ("yaw", "region"))
        low, high = check_vector(f"{where}[{i}].yaw", band["yaw"], 2, -1.6, 1.6).tolist()
        if not low < high:
            raise InvalidValueError(f"{where}[{i}].yaw", band["yaw"], "must be [lowest, highest]")
        regions.append(FootholdRegion(low, high, _polygon(f"{where}[{i}].region", band["region"])))
    if not regions:
        raise InvalidValueError(where, data, "must have at least one band of yaws")
    return tuple(regions)


def _max_reference(data: Any) -> Mapping[str, tuple[float, float]]:
    where = "robot.max_reference"
    values = check_complete(where, data, ("vx", "vy", "yaw_rate"))
    limits: dict[str, tuple[float, float]] = {}
    for key, limit in values.items():
        low, high = check_vector(f"{where}.{key}", limit, 2, -FASTEST, FASTEST).tolist()
        if not low <= 0.0 <= high:
            raise InvalidValueError(f"{where}.{key}", limit, "must be [lowest, highest] with zero between them")
        limits[key] = (low, high)
    return limits


def _swing_moments(data: Any) -> SwingMoments:
    where = "robot.swing_moments"
    values = check_complete(where, data, ("foot", "knee", "com"))
    return SwingMoments(**{key: check_range(f"{where}.{key}", value, -1.0, 1.0) for key, value in values.items()})


def _parameters(data: Any) -> Parameters:
    where = "robot.gait"
    values = check_mapping(where, data)
    check_keys(where, values, set(GAIT))
    try:
        return Parameters().changed(values)
    except InvalidValueError as error:
        raise InvalidValueError(f"{where}.{error.field}", error.value, error.limit) from error


def _body(data: Any, folder: Path) -> BodyModel:
    where = "robot.body"
    values = check_mapping(where, data)
    check_keys(where, values, {*BODY_REQUIRED, *BODY_OPTIONAL})
    for key in BODY_REQUIRED:
        if key not in values:
            raise InvalidValueError(f"{where}.{key}", None, "is missing")
    if "package" in values:
        folder = _package_folder(check_text(f"{where}.package", values["package"]), str(values.get("folder", "")))
    urdf = _file(f"{where}.urdf", folder, values["urdf"])
    srdf = None if "srdf" not in values else _file(f"{where}.srdf", folder, values["srdf"])
    if (srdf is None) is not ("posture" not in values):
        raise InvalidValueError(
            f"{where}.posture", values.get("posture"), "needs an srdf beside it, and an srdf needs it"
        )
    packages = folder.parents[2] if "package" in values else folder / str(values.get("package_folder", "."))
    angles = check_mapping(f"{where}.posture_angles", values.get("posture_angles", {}))
    fixed = check_list(f"{where}.fixed_joints", values.get("fixed_joints", []), MAX_JOINTS)
    return BodyModel(
        urdf=urdf,
        package_folder=packages,
        left_sole_frame=_fixed_frame(f"{where}.left_sole", values["left_sole"], "left_sole"),
        right_sole_frame=_fixed_frame(f"{where}.right_sole", values["right_sole"], "right_sole"),
        torso_frame=_fixed_frame(f"{where}.torso", values["torso"], "torso_upright"),
        srdf=srdf,
        posture=check_text(f"{where}.posture", values.get("posture", "")),
        posture_angles=tuple(
            (joint, check_range(f"{where}.posture_angles.{joint}", angle, -7.0, 7.0)) for joint, angle in angles.items()
        ),
        fixed_joints=tuple(check_text(f"{where}.fixed_joints[{i}]", joint) for i, joint in enumerate(fixed)),
        replaced_limits=tuple(_replaced_limits(f"{where}.replaced_limits", values.get("replaced_limits", {}))),
    )


def _replaced_limits(where: str, data: Any) -> Iterator[ReplacedLimits]:
    for joint, item in check_mapping(where, data).items():
        field = f"{where}.{joint}"
        given = check_mapping(field, item)
        check_keys(field, given, {"source", *JOINT_LIMITS})
        if "source" not in given:
            raise InvalidValueError(f"{field}.source", None, "must say where the limits come from")
        limits = {
            key: check_range(f"{field}.{key}", given[key], *JOINT_LIMITS[key]) for key in JOINT_LIMITS if key in given
        }
        if not limits:
            raise InvalidValueError(field, item, f"must have one of {', '.join(JOINT_LIMITS)}")
        yield ReplacedLimits(joint, check_text(f"{field}.source", given["source"]), **limits)


def _package_folder(package: str, folder: str) -> Path:
    """A folder in an installed wheel."""
    try:
        return Path(str(distribution(package).locate_file(folder)))
    except (PackageNotFoundError, ValueError) as error:
        raise InvalidValueError("robot.body.package", package, "is not installed") from error


def _file(where: str, folder: Path, name: Any) -> Path:
    path = folder / check_text(where, name)
    if not is_file(path):
        raise InvalidValueError(where, name, f"must be a file in {folder}")
    return path


def _fixed_frame(where: str, data: Any, name: str) -> FixedFrame:
    """A frame of the URDF by its name, or one that is fixed to a link of it."""
    if isinstance(data, str):
        return FixedFrame(data, data)
    defaults = {"position": [0.0, 0.0, 0.0], "rpy": [0.0, 0.0, 0.0]}
    values = check_complete(where, defaults | check_mapping(where, data), ("link", "position", "rpy"))
    x, y, z = check_vector(f"{where}.position", values["position"], 3, -LARGEST, LARGEST).tolist()
    roll, pitch, yaw = check_vector(f"{where}.rpy", values["rpy"], 3, -7.0, 7.0).tolist()
    return FixedFrame(name, check_text(f"{where}.link", values["link"]), (x, y, z), (roll, pitch, yaw))
