#pragma once

namespace taclink::server {

/// Two joints that turn about z, 300 mm and 250 mm links along x. Wrist fixed to the end, a quarter turn
/// about x.
inline constexpr const char* kTwoJointArm = R"(<?xml version="1.0"?>
<robot name="planar">
  <link name="world"/> <link name="upper"/> <link name="lower"/>
  <link name="wrist">
    <visual> <origin xyz="0 0 0.01"/> <geometry><box size="0.1 0.1 0.02"/></geometry> </visual>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="world"/> <child link="upper"/> <origin xyz="0 0 0.1" rpy="0 0 0"/>
    <axis xyz="0 0 1"/> <limit lower="-2" upper="2" effort="1" velocity="1"/>
  </joint>
  <joint name="elbow" type="continuous">
    <parent link="upper"/> <child link="lower"/> <origin xyz="0.3 0 0"/> <axis xyz="0 0 2"/>
  </joint>
  <joint name="flange" type="fixed">
    <parent link="lower"/> <child link="wrist"/> <origin xyz="0.25 0 0" rpy="1.5707963267948966 0 0"/>
  </joint>
</robot>)";

/// Turn about y, slide along z, turn about a slanted axis; and a finger that mimics the slide, mirrored by a
/// second one that mimics the first.
inline constexpr const char* kThreeJointArm = R"(<robot name="spatial">
  <link name="root"/> <link name="a"/> <link name="b"/> <link name="tip"/> <link name="finger"/> <link name="thumb"/>
  <joint name="pitch" type="revolute">
    <parent link="root"/> <child link="a"/> <origin xyz="0.1 0.2 0.3" rpy="0.4 -0.5 0.6"/>
    <axis xyz="0 1 0"/> <limit lower="-3" upper="3" effort="1" velocity="1"/>
  </joint>
  <joint name="lift" type="prismatic">
    <parent link="a"/> <child link="b"/> <origin xyz="0.05 0 0.4" rpy="0 0.3 0"/>
    <axis xyz="0 0 1"/> <limit lower="0" upper="0.5" effort="1" velocity="1"/>
  </joint>
  <joint name="twist" type="revolute">
    <parent link="b"/> <child link="tip"/> <origin xyz="0 0.02 0.1" rpy="0.2 0 -0.7"/>
    <axis xyz="1 1 0"/> <limit effort="1" velocity="1"/>
  </joint>
  <joint name="grip" type="prismatic">
    <parent link="tip"/> <child link="finger"/> <origin xyz="0.01 0 0.05"/>
    <axis xyz="1 0 0"/> <limit lower="-1" upper="1" effort="1" velocity="1"/>
    <mimic joint="lift" multiplier="-0.5" offset="0.03"/>
  </joint>
  <joint name="grip_too" type="revolute">
    <parent link="finger"/> <child link="thumb"/> <origin xyz="0 0 0.02"/>
    <axis xyz="0 1 0"/> <limit lower="-1" upper="1" effort="1" velocity="1"/>
    <mimic joint="grip" multiplier="3" offset="0.1"/>
  </joint>
</robot>)";

}  // namespace taclink::server
