"""From the instrument's frame to an anatomical one fixed in the same body [Alem77].

The rig says where its sensors sit in the instrument's frame. With the anatomical frame's origin O and its yaw, pitch,
roll there, C of which takes anatomical to instrument components, a place r and an axis n of the instrument are

    r' = Cᵀ (r − O),    n' = Cᵀ n

in the anatomical frame; readings stay what they are. All that is computed from the array is then anatomical: ω, α, a of
O, points, attitude, and their uncertainties.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nineaudit.array import FloatArray, SensorArray, frozen
from nineaudit.physics.laboratory import attitude_of
from nineaudit.rig import Rig


def in_frame(rig: Rig, origin: FloatArray, euler: FloatArray) -> Rig:
    """The rig with sensors and points in a frame at `origin` (3,) m, turned by `euler` (3,) yaw, pitch, roll rad.

    Schemes that need sensors along the axes (3-2-2-2, periphery, co-planar) find theirs only where the turn keeps them
    so; `product-free` is 3-2-2-2 in any frame.
    """
    turn = attitude_of(np.asarray(euler, dtype=np.float64))

    def seen(place: FloatArray) -> FloatArray:
        return frozen((place - origin) @ turn)

    sensors = tuple(replace(s, position=seen(s.position), axis=frozen(s.axis @ turn)) for s in rig.array.sensors)
    points = tuple(replace(p, position=seen(p.position)) for p in rig.points)
    return replace(rig, array=SensorArray(sensors), points=points)
