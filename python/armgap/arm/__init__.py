"""Arms: what an arm file or a description of the robot says, as a chain of links with parameters, limits and a controller.

=================  ================================================================================
file               what
=================  ================================================================================
`rigid_body`       the ten inertial numbers of a link
`controller`       the position controller of a serial arm
`serial_chain`     the chain of a serial arm
`free_space`       links as capsules, boxes in their way
`serial_toml`      a serial arm as text
`arm`              `Arm`, `MotionLimits`
`corrections`      how columns of a log are read otherwise
`description`      URDF and MJCF as a tree, resolved to a chain; changes to their text
`serial_links`     links of a serial arm in an arm file
`serial_trust`     default standard deviations of a serial arm's parameters
`serial_arm_file`  arm files of serial arms
`arm_file`         arm files
`model`            `read_model`: a description as an arm
=================  ================================================================================
"""

from armgap.arm.arm import Arm, MotionLimits, kinds, listed, only_planar, quoted

__all__ = ["Arm", "MotionLimits", "kinds", "listed", "only_planar", "quoted"]
