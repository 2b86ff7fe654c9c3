"""Arms: an arm file, or a URDF or MJCF description, read as a chain of links with parameters, limits and a controller.

=================  ================================================================================
file               what
=================  ================================================================================
`rigid_body`       the ten inertial parameters of a link
`controller`       the position controller of a serial arm
`serial.chain`     the chain of a serial arm
`free_space`       links as capsules, obstacles as boxes
`serial.toml`      the arm file of a serial arm as text
`arm`              `Arm`, `MotionLimits`
`corrections`      corrections of a log's columns: signs, zeros, units, order
`description`      URDF and MJCF as a tree, resolved to a chain; edits of URDF and MJCF text
`serial.links`     links of a serial arm in an arm file
`serial.trust`     default standard deviations of a serial arm's parameters
`serial.arm_file`  reading and checking of arm files of serial arms
`arm_file`         reading and checking of arm files
`model`            `read_model`: a robot's description read as an arm
=================  ================================================================================
"""

from armgap.arm.arm import Arm, MotionLimits, kinds, listed, only_planar, quoted

__all__ = ["Arm", "MotionLimits", "kinds", "listed", "only_planar", "quoted"]
