"""An import refuses a URDF that cannot walk in one line: the element, its value, and the remedy."""

import re

import numpy as np
import pytest
from test_synthetic_biped import biped, link

from walkcore.errors import InvalidValueError
from walkcore.robot_file import robot_from_mapping
from walkcore.robot_import.findings import findings
from walkcore.robot_import.measure import measure, robot_mapping

BIPED = biped(1.0)


def changed(pattern, by, count=1):
    text, number = re.subn(pattern, by, BIPED, count=count, flags=re.DOTALL)
    assert number > 0, "the pattern is not in the URDF"
    return text


def without_ankles():
    return re.sub(r'\s*<(link|joint) name="(left|right)_ankle_\w+".*?</\1>', "", BIPED, flags=re.DOTALL)


def quadruped():
    joint = '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{0}_link"/><origin xyz="{2}"/>'
    joint += '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="9"/></joint>'
    parts = [link("trunk", 20.0, (0.6, 0.3, 0.15))]
    for x, front in ((0.3, "front"), (-0.3, "hind")):
        for y, side in ((0.15, "left"), (-0.15, "right")):
            parts += [link(f"{front}_{side}_{name}_link", 1.0, (0.05, 0.05, 0.2)) for name in ("hip", "knee")]
            parts.append(joint.format(f"{front}_{side}_hip", "trunk", f"{x} {y} 0"))
            parts.append(joint.format(f"{front}_{side}_knee", f"{front}_{side}_hip_link", "0 0 -0.3"))
    return f'<robot name="quadruped">{"".join(parts)}</robot>'


LONE_LINK = '<robot name="a"><link name="a"><inertial><mass value="1"/></inertial></link></robot>'
POINT = r'(<link name="(?:left|right)_ankle_roll_link">.*?)<visual>.*?</collision>'
SPHERE = r'\1<collision><geometry><sphere radius="0.03"/></geometry></collision>'


@pytest.mark.parametrize(
    ("urdf", "field", "said"),
    [
        ("", "urdf", "which is XML"),
        (BIPED[: len(BIPED) // 2], "urdf", "which is XML: unclosed token: line"),
        ("<sdf/>", "urdf", "root is <robot>"),
        ("<robot/>", "urdf", "must have a name"),
        ('<robot name="a" xmlns:x="http://ros.org/xacro"><x:include filename="a"/></robot>', "urdf", "expanded first"),
        ('<robot name="a"/>', "urdf", "must have links"),
        (LONE_LINK, "urdf", "joints that move"),
        (changed(r'<parent link="trunk"/>', '<parent link="no"/>'), "urdf.joint.left_hip_yaw.parent", "add it"),
        (changed(r'"trunk"/>', '"left_knee_link"/>'), "urdf: links", "without a loop"),
        (BIPED.replace("</robot>", '<link name="lost"/></robot>'), "urdf: links that no joint moves", "trunk, lost"),
        (changed(r'<child link="right_knee_link"', '<child link="left_knee_link"'),
         "urdf.link.left_knee_link", "no loops"),
        (changed(r'name="right_knee_link"', 'name="left_knee_link"'), "urdf.link", "not of 2"),
        (changed(r'<mass value="5.0"', '<mass value="nan"'),
         "urdf.link.left_hip_pitch_link.inertial.mass.value", "must be a number"),
        (changed(r'<mass value="5.0"', '<mass value="-5"'), "urdf.link.left_hip_pitch_link.inertial.mass", "negative"),
        (changed(r'<axis xyz="0 0 1"', '<axis xyz="0 1"'), "urdf.joint.left_hip_yaw.axis.xyz", "3 numbers"),
        (changed(r"<inertial>.*?</inertial>", "", 0), "urdf", "each needs an <inertial>"),
        (changed(r"<limit [^>]*/>", ""), "urdf.joint.left_hip_yaw", 'must have a <limit lower="..."'),
        (changed('"revolute"', '"continuous"', 0), "left leg", "make it revolute"),
        (changed(r'upper="2.4"', 'upper="0.1"', 0), "left knee", "must bend by 0.2 rad.*-0.05, 0.1"),
        (changed("0 0 -0.4", "0 0 0.4", 0), "height of the CoM", "must point up"),
        (changed(POINT, SPHERE, 0), "left foot", "must be flat.*on a point"),
        (changed(r"<(visual|collision)>.*?</\1>", "", 0), "left foot", "must have a shape"),
        (changed(r'<box size="0.2 0.1 0.03"/>', '<mesh filename="package://mine/foot.stl"/>', 0), "urdf",
         "package://mine/foot.stl; --packages names the folder"),
        (without_ankles(), "left leg", "must have at least 6"),
        (quadruped(), "urdf", "must have two"),
    ],
)  # fmt: skip
def test_a_urdf_that_cannot_walk_is_refused_with_what_to_do(urdf, field, said, tmp_path):
    file = tmp_path / "mine.urdf"
    file.write_text(urdf, encoding="utf-8")
    with pytest.raises(InvalidValueError, match=said) as refusal:
        measure(file, tmp_path)
    assert refusal.value.field == field
    assert "\n" not in str(refusal.value) and len(str(refusal.value)) < 250


def imported(urdf, tmp_path):
    file = tmp_path / "mine.urdf"
    file.write_text(urdf, encoding="utf-8")
    measured = measure(file, tmp_path)
    return measured, robot_from_mapping(robot_mapping(measured, "mine", tmp_path), tmp_path / "mine.yaml")


def test_joints_without_torque_are_told_in_one_line(tmp_path):
    told = list(findings(*imported(changed(r'effort="[^"]*"', 'effort="0"', 0), tmp_path)))
    assert len(told) == 1 and told[0].startswith("no torque: left_hip_yaw, left_hip_roll")


def test_joints_that_mimic_others_are_held_fast_outside_of_the_legs_and_told_within(tmp_path):
    finger = '<joint name="finger" type="revolute"><parent link="trunk"/><child link="tip"/><axis xyz="0 1 0"/>'
    finger += (
        '<mimic joint="left_knee"/><limit lower="-1" upper="1" effort="9" velocity="9"/><origin xyz="0 0 0.5"/></joint>'
    )
    ankle = r'\1<mimic joint="left_hip_roll"/></joint>'
    text = changed(r'(<joint name="left_ankle_roll".*?)</joint>', ankle)
    text = text.replace("</robot>", link("tip", 0.1, (0.02, 0.02, 0.02)) + finger + "</robot>")
    measured, robot = imported(text, tmp_path)
    assert measured.fixed_joints == ("finger",) and robot.body.fixed_joints == ("finger",)
    told = list(findings(measured, robot))
    assert any(line.startswith("leg joints that mimic others") and "left_ankle_roll;" in line for line in told)
    assert any(line.startswith("held fast") and "finger" in line for line in told)


def test_names_of_links_and_joints_mean_nothing_to_an_import(tmp_path):
    names = re.findall(r'<(?:link|joint) name="([^"]*)"', BIPED)
    renamed = BIPED
    for number, name in enumerate(names):
        renamed = renamed.replace(f'"{name}"', f'"part{number}"')
    robots = [imported(text, tmp_path)[1] for text in (BIPED, renamed)]
    assert np.array_equal(robots[0].sole, robots[1].sole)
    assert robots[0].com_height == robots[1].com_height and robots[0].stance_width == robots[1].stance_width
