"""From the tool to the joints and back, for robots whose lengths are known.

`find_joints` and `find_tool` are the inverse and the forward kinematics, `joint_jacobian` what the joints do for a
velocity of the tool, `singularity_margin` how far that is from losing its meaning, and `plan_joints` turns a sampled
trajectory into a path of the joints, or says where and when the robot cannot follow it.
"""

from tagsway.robots.kinematics import find_joints, find_tool, joint_jacobian, singularity_margin
from tagsway.robots.path import plan_joints

__all__ = ["find_joints", "find_tool", "joint_jacobian", "plan_joints", "singularity_margin"]
