"""Every kind of joint, by the name of its element in the deck."""

from msahl.joints import (
    crossed_cylinders,
    cylindrical,
    cylindrical_slider,
    distance,
    edge_slider,
    knife_edge,
    parallel_cylinders,
    planar,
    point_on_line,
    point_slider,
    prismatic,
    revolute,
    rigid,
    rolling_disk,
    screw,
    spherical,
    spherical_slider,
    universal,
)
from msahl.joints.joint import Kind

KINDS: dict[str, Kind] = {
    module.KIND.name: module.KIND
    for module in (
        rigid,
        revolute,
        prismatic,
        cylindrical,
        spherical,
        planar,
        parallel_cylinders,
        edge_slider,
        cylindrical_slider,
        point_slider,
        spherical_slider,
        crossed_cylinders,
        universal,
        screw,
        distance,
        point_on_line,
        knife_edge,
        rolling_disk,
    )
}
