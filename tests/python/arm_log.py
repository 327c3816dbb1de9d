"""A robot arm's URDF and its log, made up: two joints, with friction that the URDF does not have."""
import numpy as np

URDF = """<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.2 0 0"/><mass value="3"/>
    <inertia ixx="0.01" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.15 0 0"/><mass value="1.5"/>
    <inertia ixx="0.005" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="100" velocity="10"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="100" velocity="10"/></joint>
</robot>
"""
STEP, COULOMB = 0.005, (1.5, 0.8)


def motion(seconds, seed):
    """Angles, rates and accelerations of two joints: sums of sines."""
    draw = np.random.default_rng(seed)
    t = np.arange(0, seconds, STEP)
    q, dq, ddq = (np.zeros((len(t), 2)) for _ in range(3))
    for joint in range(2):
        for harmonic in range(1, 6):
            a, phase = draw.uniform(0.1, 0.3), draw.uniform(0, 6.28)
            w = 2 * np.pi * 0.1 * harmonic * (1 + 0.3 * joint)
            q[:, joint] += a * np.sin(w * t + phase)
            dq[:, joint] += a * w * np.cos(w * t + phase)
            ddq[:, joint] -= a * w * w * np.sin(w * t + phase)
    return t, q, dq, ddq


def torques(q, dq, ddq):
    """Of the two links of the URDF in a vertical plane (axis y: positive angles go down)."""
    m1, c1, i1, l1, m2, c2, i2, g = 3.0, 0.2, 0.05, 0.4, 1.5, 0.15, 0.02, 9.81
    cos2, sin2, k = np.cos(q[:, 1]), np.sin(q[:, 1]), m2 * l1 * c2
    inner = i2 + m2 * c2**2
    tau1 = ((i1 + m1 * c1**2 + m2 * l1**2 + inner + 2 * k * cos2) * ddq[:, 0]
            + (inner + k * cos2) * ddq[:, 1]
            - k * sin2 * (2 * dq[:, 0] * dq[:, 1] + dq[:, 1]**2))
    tau2 = (inner + k * cos2) * ddq[:, 0] + inner * ddq[:, 1] + k * sin2 * dq[:, 0]**2
    lower = m2 * c2 * g * np.cos(q.sum(axis=1))
    tau1 -= (m1 * c1 + m2 * l1) * g * np.cos(q[:, 0]) + lower
    return np.stack([tau1, tau2 - lower], axis=1)


def write(folder):
    """arm.urdf and log.csv."""
    (folder / "arm.urdf").write_text(URDF)
    t, q, dq, ddq = motion(60, 4)
    draw = np.random.default_rng(5)
    tau = torques(q, dq, ddq) + np.sign(dq) * COULOMB + draw.normal(0, 0.05, q.shape)
    np.savetxt(folder / "log.csv", np.column_stack([t, q + draw.normal(0, 1e-5, q.shape), tau]),
               delimiter=",", comments="", fmt="%.9g",
               header="time [s],shoulder_position [rad],elbow_position [rad],"
                      "shoulder_torque [N m],elbow_torque [N m]")
