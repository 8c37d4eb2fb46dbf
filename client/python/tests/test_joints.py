"""An arm with a joint: where its link is, and what contacts cause on the joint."""

from __future__ import annotations

import itertools
import time
from pathlib import Path
from typing import Iterator

import numpy as np
import pytest
import server as servers

import taclink

# The link swings about the base frame's y axis.
URDF = """<robot name="arm">
  <link name="base"/> <link name="forearm"/>
  <joint name="elbow" type="revolute">
    <parent link="base"/> <child link="forearm"/> <axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/>
  </joint>
</robot>
"""


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[servers.Server]:
    folder = tmp_path_factory.mktemp("joints")
    (folder / "arm.urdf").write_text(URDF)
    pose = ", pose: {frame: forearm, position_mm: [0, 0, 0], rotation_deg: [0, 0, 90]}"
    links = servers.links(servers.link("skin", "press", pose))
    config = servers.HEAD + links.replace("  name: test\n", "  name: test\n  urdf: arm.urdf\n", 1)
    running = servers.measuring(folder, config, "skin")
    yield running
    running.stop()


@pytest.fixture
def client(arm: servers.Server) -> Iterator[taclink.Client]:
    with taclink.Client(arm.address, timeout=servers.PATIENCE_S) as connected:
        yield connected


def test_the_joint_is_described(client: taclink.Client) -> None:
    arm = client.arm()
    assert arm.base_frame == "base" and arm.links[0].frame == "forearm"
    (elbow,) = arm.joints
    assert (elbow.name, elbow.kind, elbow.lower, elbow.upper) == ("elbow", "revolute", -2, 2)


def test_contacts_turn_with_the_joint(client: taclink.Client) -> None:
    angle = 0.5
    start_ns = time.time_ns()
    with client.update_joint_states() as joints, client.contacts() as contacts:
        for number in itertools.count():
            joints.write({"elbow": angle}, {"elbow": 0.0})
            arm = next(contacts)
            told = arm.validity in ("interpolated", "extrapolated") and arm.links[0].times.exposure_utc_ns > start_ns
            if told and arm.contacts and np.linalg.norm(arm.total_force_n) > 0.19:
                break
            assert number < 10_000
    turned = np.array(
        [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    ) @ [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    pose = arm.links[0].base_from_link
    assert pose.rotation == pytest.approx(turned, abs=1e-6)
    (contact,) = arm.contacts
    # On the arm's -x side, turned with it; only the moment about y moves the joint.
    assert contact.force_n @ turned[:, 1] == pytest.approx(-0.2, rel=0.1)
    (torque,) = arm.joints
    assert torque.joint == "elbow"
    assert torque.torque_nm == pytest.approx(arm.total_moment_nm[1])
    assert torque.sigma_nm is not None and torque.sigma_nm > 0
    assert joints.summary is not None
    assert joints.summary.accepted + joints.summary.refused == number + 1
    assert client.arm().joints[0].position == pytest.approx(angle)


def test_names_may_be_given_once(client: taclink.Client) -> None:
    with client.update_joint_states() as joints:
        joints.write([0.1], [0.0], names=["elbow"])
        joints.write([0.2], monotonic_ns=time.monotonic_ns())
    assert joints.summary is not None and joints.summary.accepted > 0


def test_what_is_wrong_with_a_state_is_said(client: taclink.Client) -> None:
    joints = client.update_joint_states()
    joints.write({"knee": 0.0})
    with pytest.raises(taclink.InvalidArgument, match="no joint 'knee'; there are: elbow"):
        joints.finish()
    with pytest.raises(taclink.InvalidArgument, match="knee"):
        for _ in range(100):  # a writer that goes on is told, too
            joints.write({"knee": 0.0})
    joints = client.update_joint_states()
    with pytest.raises(taclink.InvalidArgument, match="same joints"):
        joints.write({"elbow": 0.0}, {"knee": 0.0})
    joints.write({"elbow": 0.0}, utc_ns=1)
    with pytest.raises(taclink.InvalidArgument, match="behind the server's clock"):
        joints.finish()
    with pytest.raises(taclink.InvalidArgument, match="range|outside"):
        with client.update_joint_states() as joints:
            joints.write({"elbow": 30.0})


def test_an_arm_without_joints_refuses_them(server: servers.Server) -> None:
    with taclink.Client(server.address, timeout=servers.PATIENCE_S) as client:
        joints = client.update_joint_states()
        joints.write({"elbow": 0.0})
        with pytest.raises(taclink.Refused, match="no URDF"):
            joints.finish()
