# pyright: basic, reportMissingImports=false, reportAttributeAccessIssue=false
# (Pinocchio ships no types that hold)
"""Sensors with noise, and the estimate of the CoM that is made from them.

An IMU tells how the torso is tilted, encoders tell the joint angles. Leg kinematics gives the CoM above the sole that
stands, c_kin; its velocity comes from the forces on the feet, corrected by what the kinematics say:

    dv = F / m dt + K_v (c_kin - c),    dc = v dt + K_c (c_kin - c)

with the steady-state gains of a Kalman filter (an alpha-beta filter; Kalata 1984, "The tracking index").
Noise is a function of seed and tick alone, so that a walk can be restored and repeated to the bit.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin

from walkcore.mpc.stance import Side
from walkcore.plant.plant import GroundContact, Measurement
from walkcore.plant.world import World
from walkcore.robot import BodyModel
from walkcore.values import Vector, frozen_copy

JOINT_NOISE = 5e-4  # [rad] of an encoder, standard deviation
TILT_NOISE = 2e-3  # [rad] of the IMU's attitude
FORCE_NOISE = 5.0  # [N] of the horizontal force on the feet
COM_GAIN = 0.1  # K_c: 2 mm of kinematic noise against 0.5 m/s^2 that the forces do not tell, such as a push
VELOCITY_GAIN = 1.0  # K_v [1/s]


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """The CoM seen from the soles that stand."""

    standing: tuple[Side, ...] = ()
    """Sides of these soles; none before the first measurement."""
    com: Vector = field(default_factory=lambda: frozen_copy(np.zeros(2)))
    """[m], shape (2,)."""
    velocity: Vector = field(default_factory=lambda: frozen_copy(np.zeros(2)))
    """[m/s], shape (2,)."""


class NoisySensors:
    """Sensors of one body, and the filter behind them."""

    def __init__(self, body: BodyModel, model: pin.Model, world: World) -> None:
        """Take the kinematics of a body.

        Args:
            body: names the soles.
            model: of Pinocchio.
            world: has the seed of the noise.
        """
        self._model, self._data, self._seed = model, model.createData(), world.seed
        self._mass = pin.computeTotalMass(model)
        self._soles = {side: model.getFrameId(body.sole(side)) for side in Side}
        self.estimate = Estimate()

    def observe(
        self,
        truth: Measurement,
        contact: GroundContact,
        standing: Sequence[Side],
        tick: int,
        period: float,
    ) -> Measurement:
        """The measurement with the CoM and its velocity as they are estimated.

        Args:
            truth: the body as it is; where its soles stand in the world is taken as known.
            contact: the forces of the ground.
            standing: sides of the soles that stand.
            tick: decides the noise.
            period: of a tick [s].
        """
        noise = np.random.Generator(np.random.Philox(key=self._seed, counter=tick)).standard_normal
        soles = np.mean([truth.soles[side].position[:2] for side in standing], axis=0)
        kinematic = self._com_above(standing, truth.q, noise)
        before = self.estimate
        if not before.standing:
            before = Estimate(tuple(standing), kinematic)
        elif before.standing != tuple(standing):  # the same CoM, seen from elsewhere
            step = self._between(before.standing, standing, truth.q)
            before = replace(before, standing=tuple(standing), com=before.com - step)
        force = contact.total[:2] + FORCE_NOISE * noise(2)
        velocity = before.velocity + force / self._mass * period
        com = before.com + velocity * period
        error = kinematic - com
        self.estimate = Estimate(
            tuple(standing), frozen_copy(com + COM_GAIN * error), frozen_copy(velocity + VELOCITY_GAIN * error)
        )
        return replace(
            truth,
            com=frozen_copy([*(soles + self.estimate.com), truth.com[2]]),
            com_velocity=frozen_copy([*self.estimate.velocity, truth.com_velocity[2]]),
        )

    def _com_above(self, standing: Sequence[Side], q: Vector, noise) -> Vector:
        """CoM relative to the middle of the soles that stand, from noisy angles [m], shape (2,)."""
        tilt = pin.exp3(np.array([*(TILT_NOISE * noise(2)), 0.0])) @ pin.Quaternion(np.array(q[3:7])).matrix()
        angles = q[7:] + JOINT_NOISE * noise(len(q) - 7)
        noisy = np.concatenate([q[:3], pin.Quaternion(tilt).coeffs(), angles])
        pin.framesForwardKinematics(self._model, self._data, noisy)
        com = pin.centerOfMass(self._model, self._data, noisy)
        return com[:2] - np.mean([self._data.oMf[self._soles[side]].translation[:2] for side in standing], axis=0)

    def _between(self, before: Sequence[Side], after: Sequence[Side], q: Vector) -> Vector:
        pin.framesForwardKinematics(self._model, self._data, np.array(q))
        middles = [
            np.mean([self._data.oMf[self._soles[s]].translation[:2] for s in sides], axis=0)
            for sides in (before, after)
        ]
        return middles[1] - middles[0]
