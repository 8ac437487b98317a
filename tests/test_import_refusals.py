"""An import refuses a URDF that cannot walk in one line: the element, its value, and the remedy."""

import re

import numpy as np
import pinocchio as pin
import pytest
from test_synthetic_biped import biped, link

from walkcore.errors import InvalidValueError
from walkcore.robot_file import robot_from_mapping
from walkcore.robot_import.findings import findings
from walkcore.robot_import.legs import find_legs
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


def renamed(urdf):
    """The same with names of links and joints that tell nothing."""
    for number, name in enumerate(re.findall(r'<(?:link|joint) name="([^"]*)"', urdf)):
        urdf = urdf.replace(f'"{name}"', f'"part{number}"')
    return urdf


def floating(urdf):
    base = '<link name="world"/><joint name="free" type="floating"><parent link="world"/><child link="trunk"/></joint>'
    return urdf.replace("</robot>", base + "</robot>")


def in_millimetres(urdf):
    """The same with a thousand times the lengths."""

    def longer(found):
        return found[1] + " ".join(str(1000.0 * float(word)) for word in found[2].split()) + found[3]

    return re.sub(r'(<(?:origin xyz|box size)=")([^"]*)(")', longer, urdf)


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
        (changed(r'upper="2.4"', 'upper="0.1"', 0), "left knee", "must bend by 0.2 rad.*-0.05 to 0.1"),
        (changed("0 0 -0.4", "0 0 0.4", 0), "height of the CoM", "must point up"),
        (changed(POINT, SPHERE, 0), "left foot", "must be flat.*on a point"),
        (changed(r"<(visual|collision)>.*?</\1>", "", 0), "left foot", "must have a shape"),
        (changed(r'<box size="0.2 0.1 0.03"/>', '<mesh filename="package://mine/foot.stl"/>', 0), "urdf",
         "package://mine/foot.stl; --packages names the folder that has mine in it"),
        (without_ankles(), "left leg", "must have at least 6"),
        (quadruped(), "urdf: lowest ends", "must be two.*with z up"),
        (changed('"revolute"', '"hinge"'), "urdf.joint.left_hip_yaw.type", "must be one of revolute"),
        (floating(BIPED), "urdf.joint.free.type", "take out world and this joint"),
        (changed('lower="-0.05" upper="2.4"', 'lower="2.4" upper="-0.05"'), "urdf.joint.left_knee.limit.lower", "swap"),
        (changed(r'<axis xyz="0 0 1"', '<axis xyz="0 0 0"'), "urdf.joint.left_hip_yaw.axis.xyz", "a direction"),
        (changed(r'<box size="0.2 0.1 0.03"', '<box size="0.2 0.1"'),
         "urdf.link.left_ankle_roll_link.visual.geometry.box.size", "must be 3 numbers"),
        (changed(r'<geometry><box size="0.2 0.1 0.03"/></geometry>', "<geometry/>"),
         "urdf.link.left_ankle_roll_link.visual", "must have a <geometry>"),
        (in_millimetres(BIPED), "left foot", "200 m long.*a URDF is in metres"),
        (changed(r'<box size="0.2 0.1 0.03"/>', '<mesh filename="$(find mine)/foot.stl"/>'), "urdf", "expanded"),
    ],
)  # fmt: skip
def test_a_urdf_that_cannot_walk_is_refused_with_what_to_do(urdf, field, said, tmp_path):
    file = tmp_path / "mine.urdf"
    file.write_text(urdf, encoding="utf-8")
    with pytest.raises(InvalidValueError, match=said) as refusal:
        measure(file, tmp_path)
    assert refusal.value.field == field
    assert "\n" not in str(refusal.value) and len(str(refusal.value)) < 250


LEFT, RIGHT = "left_ankle_roll_link", "right_ankle_roll_link"


@pytest.mark.parametrize(
    ("feet", "torso", "field", "said"),
    [
        ((RIGHT, LEFT), "", "left_foot", "its name says right: swap --left-foot and --right-foot"),
        ((LEFT, LEFT), "", "right_foot", "must have a leg of its own"),
        ((LEFT, "left_ankle_pitch_link"), "", "right_foot", "must have a leg of its own"),
        (("left_knee_link", "right_knee_link"), "", "left leg", "must have at least 6"),
        (("trunk", RIGHT), "", "left_foot", "it is part of the base"),
        ((LEFT, "nothing"), "", "right_foot", "must be a link of the URDF"),
        ((LEFT, RIGHT), "nothing", "torso", "must be a link of the URDF"),
        ((LEFT, RIGHT), "right_knee_link", "torso", "it hangs on the right one"),
    ],
)
def test_feet_and_torso_that_cannot_be_those_are_refused(feet, torso, field, said, tmp_path):
    (tmp_path / "mine.urdf").write_text(BIPED, encoding="utf-8")
    with pytest.raises(InvalidValueError, match=said) as refusal:
        measure(tmp_path / "mine.urdf", tmp_path, feet, torso)
    assert refusal.value.field == field and "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("at_left", "at_right"),
    [("ankle_r", "ankle"), ("ankle", "ankle_l"), ("right_ankle", "ankle"), ("ankle", "left_ankle")],
)
def test_legs_are_told_apart_by_the_name_of_one_ankle_wherever_it_is(at_left, at_right, tmp_path):
    text = BIPED.replace('joint name="left_ankle_roll"', f'joint name="{at_left}"')
    text = text.replace('joint name="right_ankle_roll"', f'joint name="{at_right}"')
    (tmp_path / "mine.urdf").write_text(text, encoding="utf-8")
    model = pin.buildModelFromUrdf(str(tmp_path / "mine.urdf"), pin.JointModelFreeFlyer())
    assert [model.names[leg.foot] for leg in find_legs(model)] == [at_right, at_left]


def test_feet_that_are_named_the_wrong_way_round_are_known_by_their_toes(tmp_path):
    text = renamed(BIPED)
    ends = sorted(set(re.findall(r'child link="(\w+)"', text)) - set(re.findall(r'parent link="(\w+)"', text)))
    (tmp_path / "mine.urdf").write_text(text, encoding="utf-8")
    refused = []
    for feet in (ends, ends[::-1]):
        try:
            measure(tmp_path / "mine.urdf", tmp_path, feet)
        except InvalidValueError as refusal:
            assert "0.120 behind, 0.080 ahead" in str(refusal)
            assert "name the feet the other way round" in str(refusal)
            refused.append(feet)
    assert len(refused) == 1


def test_legs_begin_where_they_part(tmp_path):
    waist = '<joint name="waist" type="revolute"><parent link="chest"/><child link="trunk"/><origin xyz="0 0 0"/>'
    waist += '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="90" velocity="9"/></joint>'
    text = BIPED.replace("</robot>", link("chest", 9.0, (0.1, 0.2, 0.2), z=0.6) + waist + "</robot>")
    measured, _ = imported(text, tmp_path)
    assert [measured.model.names[leg.joints[0]] for leg in measured.legs] == ["left_hip_yaw", "right_hip_yaw"]


def imported(urdf, tmp_path):
    file = tmp_path / "mine.urdf"
    file.write_text(urdf, encoding="utf-8")
    measured = measure(file, tmp_path)
    return measured, robot_from_mapping(robot_mapping(measured, "mine", tmp_path), tmp_path / "mine.yaml")


def test_joints_without_torque_are_told_in_one_line(tmp_path):
    told = list(findings(*imported(changed(r'effort="[^"]*"', 'effort="0"', 0), tmp_path)))
    assert len(told) == 1 and told[0].startswith("no torque: left_hip_yaw, left_hip_roll")


@pytest.mark.parametrize(
    ("urdf", "said"),
    [
        (changed(r'<mass value="5.0"', '<mass value="0"', 0), ["no mass.*left_hip_pitch, right_hip_pitch; give it"]),
        (changed(r'(<mass value="5.0"/>\s*<inertia) ixx="[^"]*"', r'\1 ixx="0"', 0),
         [r"not positive.*left_hip_pitch \(0 kg m\^2\), right_hip_pitch.*contact physics refuses"]),
        (changed(r'(<mass value="5.0"/>\s*<inertia) ixx="[^"]*"', r'\1 ixx="9"'),
         ["no body has.*: left_hip_pitch; contact", "no mirror images: left_hip_pitch and right_hip_pitch; one may"]),
        (changed(r'lower="-2.0" upper="1.0"', 'lower="-120" upper="60"', 0), ["left_hip_pitch, right_hip.*in radians"]),
    ],
)  # fmt: skip
def test_oddities_of_one_kind_are_told_in_one_line_with_what_to_do(urdf, said, tmp_path):
    told = list(findings(*imported(urdf, tmp_path)))
    assert len(told) == len(said), told
    assert all(re.search(words, line) for words, line in zip(said, told, strict=True)), told


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
    robots = [imported(text, tmp_path)[1] for text in (BIPED, renamed(BIPED))]
    assert np.array_equal(robots[0].sole, robots[1].sole)
    assert robots[0].com_height == robots[1].com_height and robots[0].stance_width == robots[1].stance_width
