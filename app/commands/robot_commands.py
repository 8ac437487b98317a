"""Commands on robots: list those that ship, import others, and find where they can step."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro

from app.settings import usable_cores
from walkcore import Robot, load_robot, robot_names
from walkcore.errors import InvalidValueError, InverseKinematicsError


@dataclass(frozen=True, slots=True)
class RobotsCommand:
    """List the robots that ship."""

    def __call__(self) -> None:
        """Print name and limits of each robot."""
        width = max(map(len, robot_names()))
        for name in robot_names():
            robot = load_robot(name)
            limits = ", ".join(f"{key} {low:g} to {high:g}" for key, (low, high) in robot.max_reference.items())
            print(f"{name:{width}} {robot.title}, {robot.mass:.1f} kg; {limits}; push {robot.max_push:g} N s")


@dataclass(frozen=True, slots=True)
class ImportCommand:
    """Measure a robot on its URDF, tell what is wrong with it, and write a robot file that walks."""

    urdf: tyro.conf.Positional[Path]
    """URDF of a biped."""
    out: Path
    """Robot file to write, such as my-robot.yaml."""
    name: str = ""
    """Name of the robot; by default that of the file."""
    packages: Path | None = None
    """Folder in which the package:// addresses of the URDF start; by default found above the URDF."""
    left_foot: str = ""
    """Link of the left foot, where the two lowest ends of the tree are not the feet."""
    right_foot: str = ""
    """Link of the right foot."""
    torso: str = ""
    """Link that is held upright; by default the heaviest that no leg moves."""
    srdf: Path | None = None
    """SRDF of the robot: its posture is taken instead of bent knees, and links that never collide are not checked."""
    posture: str = "half_sitting"
    """Name of the posture in the SRDF."""
    picture: bool = True
    """Whether the robot is drawn as it stands, into a PNG beside the file."""
    footholds: bool = False
    """Whether the regions of the feet, as by `walk footholds`, and the fastest references are found by simulation."""
    samples: int = 3000
    """Placements to try for the footholds."""

    def __call__(self) -> None:
        """Measure, write and tell."""
        from walkcore.robot_file import robot_from_mapping  # the libraries of the body take a second to load
        from walkcore.robot_import.findings import findings
        from walkcore.robot_import.measure import measure, robot_mapping

        for name, file in (("urdf", self.urdf), ("srdf", self.srdf)):
            if file is not None and not file.is_file():
                raise InvalidValueError(name, str(file), "must be a file")
        if not self.out.parent.is_dir():
            raise InvalidValueError("out", str(self.out), "must be a file in a folder that is there")
        if bool(self.left_foot) is not bool(self.right_foot):
            raise InvalidValueError(
                "right_foot", self.right_foot, "must be given where left_foot is, and the other way"
            )
        feet = (self.left_foot, self.right_foot) if self.left_foot else ()
        progress("legs, soles and posture")
        packages = self.packages or package_folder(self.urdf)
        measured = measure(self.urdf, packages, feet, self.torso, self.srdf, self.posture)
        values = robot_mapping(measured, self.name or self.out.stem, self.out.parent)
        robot = robot_from_mapping(values, self.out)
        progress("inertias, mirror images and torques")
        notes = list(findings(measured, robot))
        origins = _limit_foot_speeds(values, robot)
        robot = self._write(values, origins)
        for finding in notes:
            print(f"note: {finding}", file=sys.stderr)
        if self.footholds:
            robot = self._with_footholds(values, origins)
            robot = self._with_speed_limits(values, robot, origins)
        robot = self._with_swing_moments(values, robot, origins)
        if self.picture:
            from app.robot_picture import draw_robot

            progress("picture")
            draw_robot(robot, self.out.with_suffix(".png"))
        legs = " and ".join(measured.model.names[leg.joints[0]] for leg in measured.legs)
        print(
            f"{self.out}: {robot.mass:.1f} kg, CoM at {robot.com_height:g} m, legs from {legs}, torso {measured.torso}"
        )
        print(f"see it walk: ROBOT={self.out} make run; find where it can step: walk footholds {self.out}")

    def _write(self, values: dict[str, Any], origins: dict[str, str]) -> Robot:
        """Write the file, with the origin of each value that was found, and return its robot."""
        from app.robot_files import robot_text

        self.out.write_text(robot_text(values, self.urdf.name, origins), encoding="utf-8")
        return load_robot(self.out)

    def _with_footholds(self, values: dict[str, Any], origins: dict[str, str]) -> Robot:
        """The robot with the regions that a study of its file finds."""
        from app.footholds.foothold_files import write
        from app.footholds.foothold_study import study
        from app.robot_files import STUDIED

        progress("footholds")
        found = study(load_robot(self.out), None, self.samples, 0, usable_cores())
        write(found, self.out.with_name(f"{self.out.stem}-footholds"))
        values["foothold_regions"] = [
            {"yaw": [region.lowest_yaw, region.highest_yaw], "region": region.vertices.tolist()}
            for region in found.regions
        ]
        origins["foothold_regions"] = STUDIED["foothold_regions"]
        return self._write(values, origins)

    def _with_speed_limits(self, values: dict[str, Any], robot: Robot, origins: dict[str, str]) -> Robot:
        """The robot with the fastest references that its joints keep."""
        from app.robot_files import STUDIED
        from walkcore.robot_import.speed_limits import fastest_references

        progress("fastest references")
        too_fast: list[str] = []
        for name, (low, high) in fastest_references(robot):
            guessed = values["max_reference"][name]
            if low == 0.0 or high == 0.0:
                too_fast.append(name)
                note = (
                    f"{name}: not even a sixth of the guessed {guessed[0]} to {guessed[1]} is within its joints' limits"
                )
                print(f"note: {note}; try another com_height, swing_height or step_duration", file=sys.stderr)
            else:
                values["max_reference"][name] = [low, high]
        origins["max_reference"] = STUDIED["max_reference"]
        if too_fast:
            origins["max_reference"] += f"; {' and '.join(too_fast)} are still guesses, which the joints do not keep"
        return self._write(values, origins)

    def _with_swing_moments(self, values: dict[str, Any], robot: Robot, origins: dict[str, str]) -> Robot:
        """The robot with the moments of its swinging leg, where it walks long enough to fit them."""
        from walkcore.robot_import.swing_fit import fit_swing_moments

        progress("swing moments")
        try:
            moments = fit_swing_moments(robot, FIT_PERIOD).moments
        except InvalidValueError as error:
            print(f"note: {error}", file=sys.stderr)
            return robot
        values["swing_moments"] = {key: round(getattr(moments, key), 4) for key in ("foot", "knee", "com")}
        return self._write(values, origins)


def _limit_foot_speeds(values: dict[str, Any], robot: Robot) -> dict[str, str]:
    """Lower the guessed speeds of the feet to what the joints of the legs allow; the origin of those in the file."""
    from app.robot_files import FOOT_SPEED, FOOT_YAW_RATE
    from walkcore.robot_import.speed_limits import USED, foot_speeds

    try:
        allowed = foot_speeds(robot)
    except InverseKinematicsError as error:
        print(f"note: speeds of the feet are guesses: a stride is too long for the legs, {error}", file=sys.stderr)
        origin = "a guess from the robot's size, as a stride at its fastest reference is too long for the legs"
        return {"max_foot_speed": FOOT_SPEED + origin}
    if allowed is None:
        return {}

    def limited(guessed: float, most: float) -> tuple[float, str]:
        speed = max(0.01, round(min(guessed, USED * most), 2))
        origin = (
            f"{USED:g} of the {most:.2f}" if speed < guessed else f"a guess from the robot's size, within {most:.2f}"
        )
        return speed, f"{origin} that the joints of the leg allow"

    x, y = values["max_foot_speed"]
    (forward, along_x), (sideways, along_y) = limited(x, allowed.forward), limited(y, allowed.sideways)
    yaw_rate, turning = limited(values["max_foot_yaw_rate"], allowed.yaw_rate)
    values |= {"max_foot_speed": [forward, sideways], "max_foot_yaw_rate": yaw_rate}
    first = f"{allowed.joint} is the first at its limit"
    return {
        "max_foot_speed": f"{FOOT_SPEED}{along_x}, and {along_y}; {first}",
        "max_foot_yaw_rate": FOOT_YAW_RATE + turning,
    }


FIT_PERIOD = 0.02  # [s] of a tick: the moments differ by 2 to 10 % from those at 5 ms, and take a fourth of the time


def progress(subject: str) -> None:
    """Tell on the error stream what is looked at."""
    print(f"... {subject}", file=sys.stderr, flush=True)


def package_folder(urdf: Path) -> Path:
    """The folder above a URDF in which its first `package://` address is found; the URDF's own if there is none."""
    text = urdf.read_text(encoding="utf-8", errors="replace")
    _, mark, rest = text.partition("package://")
    first = rest.partition('"')[0]
    found = (folder for folder in urdf.resolve().parents if (folder / first).is_file())
    return next(found, urdf.parent) if mark else urdf.parent


@dataclass(frozen=True, slots=True)
class FootholdsCommand:
    """Find the regions where a robot may put its feet, by trying thousands of steps."""

    robot: tyro.conf.Positional[str]
    """Robot with a body: a name (see `walk robots`), or the path of a robot file."""
    out: Path = Path("footholds")
    """Folder for footholds.yaml, footholds.csv and footholds.svg."""
    samples: int = 3000
    """Placements to try, before those along the edges of the polygons."""
    seed: int = 0
    """Seed of the samples: the same seed gives the same polygons."""
    com_height: float | None = None
    """Height of the CoM above the ground [m]; the robot's own if not given."""

    def __call__(self) -> None:
        """Try, write, and print the regions."""
        from app.footholds.foothold_files import summary, write  # draws: a library that takes a second to load
        from app.footholds.foothold_study import study

        found = study(load_robot(self.robot), self.com_height, self.samples, self.seed, usable_cores())
        write(found, self.out)
        print(summary(found), end="")
