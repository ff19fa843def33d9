"""A URDF as SDF, by two ways to state poses and axes."""

import numpy as np
from lxml import etree

from msahl.importers.urdf import roll_pitch_yaw

DYNAMICS = ("damping", "friction")


def words(values):
    return " ".join(repr(float(x)) for x in values)


def origin(element):
    given = None if element is None else element.find("origin")
    xyz = "0 0 0" if given is None else given.get("xyz", "0 0 0")
    rpy = "0 0 0" if given is None else given.get("rpy", "0 0 0")
    return f"{xyz} {rpy}"


def matrix(pose):
    values = [float(word) for word in pose.split()]
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = roll_pitch_yaw(*values[3:]), values[:3]
    return T


def pose_text(T):
    """x y z roll pitch yaw of a frame."""
    R = T[:3, :3]
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    angles = np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])
    return words([*T[:3, 3], *angles])


def sdf_of(urdf, absolute):
    """The text of a URDF as SDF 1.9 with poses of joints relative to the parent link, or as SDF
    1.5 with ``absolute`` poses of links and axes in the axes of the model."""
    root = etree.fromstring(urdf)
    joints = {j.find("child").get("link"): j for j in root.iterfind("joint")}
    lines = [f'<sdf version="{"1.5" if absolute else "1.9"}"><model name="{root.get("name")}">']
    base = next(name for name in root.xpath("link/@name") if name not in joints)
    places = {}
    for link in root.iterfind("link"):
        lines += link_lines(link, joints.get(link.get("name")), joints, places, absolute)
    fixed = "<parent>world</parent>"
    lines.append(f'<joint name="to world" type="fixed">{fixed}<child>{base}</child></joint>')
    for joint in joints.values():
        lines += joint_lines(joint, places, absolute)
    return "\n".join([*lines, "</model></sdf>"])


def place_of(name, joints, places):
    if name not in places:
        joint = joints.get(name)
        if joint is None:
            places[name] = np.eye(4)
        else:
            parent = place_of(joint.find("parent").get("link"), joints, places)
            places[name] = parent @ matrix(origin(joint))
    return places[name]


def link_lines(link, joint, joints, places, absolute):
    name = link.get("name")
    place = place_of(name, joints, places)
    yield f'<link name="{name}">'
    if absolute:
        yield f"<pose>{pose_text(place)}</pose>"
    elif joint is not None:
        yield f'<pose relative_to="{joint.get("name")}"/>'
    inertial = link.find("inertial")
    if inertial is None:
        zero = "<ixx>0</ixx><iyy>0</iyy><izz>0</izz>"
        yield f"<inertial><mass>0</mass><inertia>{zero}</inertia></inertial>"
    else:
        yield f"<inertial><pose>{origin(inertial)}</pose>"
        yield f"<mass>{inertial.find('mass').get('value')}</mass><inertia>"
        yield from (f"<{k}>{v}</{k}>" for k, v in inertial.find("inertia").attrib.items())
        yield "</inertia></inertial>"
    for shape in link.iterfind("visual"):
        yield f"<visual name='v'><pose>{origin(shape)}</pose><geometry>"
        for kind in shape.find("geometry"):
            yield f"<{kind.tag}>"
            yield from (f"<{k}>{v}</{k}>" for k, v in kind.attrib.items())
            yield f"</{kind.tag}>"
        yield "</geometry></visual>"
    yield "</link>"


def joint_lines(joint, places, absolute):
    parent, child = joint.find("parent").get("link"), joint.find("child").get("link")
    yield f'<joint name="{joint.get("name")}" type="{joint.get("type")}">'
    if not absolute:
        yield f'<pose relative_to="{parent}">{origin(joint)}</pose>'
    yield f"<parent>{parent}</parent><child>{child}</child>"
    if joint.get("type") != "fixed":
        axis = joint.find("axis")
        xyz = np.array((axis.get("xyz") if axis is not None else "1 0 0").split(), dtype=float)
        yield "<axis>"
        if absolute:
            xyz = places[child][:3, :3] @ xyz
            yield "<use_parent_model_frame>true</use_parent_model_frame>"
        yield f"<xyz>{words(xyz)}</xyz>"
        limit, dynamics, mimic = (joint.find(tag) for tag in ("limit", "dynamics", "mimic"))
        if limit is not None:
            ends = "".join(f"<{k}>{v}</{k}>" for k, v in limit.attrib.items())
            yield f"<limit>{ends}</limit>"
        if dynamics is not None:
            given = "".join(f"<{k}>{dynamics.get(k, 0)}</{k}>" for k in DYNAMICS)
            yield f"<dynamics>{given}</dynamics>"
        if mimic is not None:
            yield f'<mimic joint="{mimic.get("joint")}">'
            yield f"<multiplier>{mimic.get('multiplier', 1)}</multiplier>"
            yield f"<offset>{mimic.get('offset', 0)}</offset><reference>0</reference></mimic>"
        yield "</axis>"
    yield "</joint>"
