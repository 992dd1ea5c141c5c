# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors and rotations, in the layouts that the work asks for.

Rotations are unit quaternions (w, x, y, z), matrices are 3 × 3 with column vectors, angles are
radians, and a product turns by its second factor first. An operation has the same name in each
layout: ``multiply``, ``conjugate``, ``rotate``, ``cross``, ``dot``, ``normalized``, ``to_matrix``,
``from_rotation_vector``, ``to_rotation_vector``, ``shortest_arc``.

- Arrays with the components last, (…, 3) and (…, 4): what this package itself hands out, and what
  is used wherever nothing speaks against it.
- :mod:`.components_first`: (…, 3, batch) and (4, batch). Each component is one run of memory, with
  which numpy works several times faster where batches are long: the hot loops of locomotion.
- :mod:`.small_batches`: (count, 3) and (count, 4) as matrix products, the fewest calls of numpy for
  some hundred rotations: the solver of posing.
- :mod:`.scalars`: tuples of floats, for one at a time: the haptic loop.
"""

from .arrays import (
    EULER_ORDERS,
    IDENTITY,
    Floats,
    angle_between,
    conjugate,
    continuous,
    continuous_axis_angle,
    continuous_euler,
    cross,
    dot,
    from_axis_angle,
    from_euler,
    from_matrix,
    from_mode_values,
    from_rotation_vector,
    lerp_rotation_vectors,
    less_whole_turns,
    multiply,
    normalized,
    rotate,
    rotate_in_plane,
    rotation_vector_between,
    shortest_arc,
    slerp,
    slerp_in_sense,
    to_euler,
    to_matrix,
    to_rotation_vector,
)

__all__ = [
    "EULER_ORDERS",
    "IDENTITY",
    "Floats",
    "angle_between",
    "conjugate",
    "continuous",
    "continuous_axis_angle",
    "continuous_euler",
    "cross",
    "dot",
    "from_axis_angle",
    "from_euler",
    "from_matrix",
    "from_mode_values",
    "from_rotation_vector",
    "lerp_rotation_vectors",
    "less_whole_turns",
    "multiply",
    "normalized",
    "rotate",
    "rotate_in_plane",
    "rotation_vector_between",
    "shortest_arc",
    "slerp",
    "slerp_in_sense",
    "to_euler",
    "to_matrix",
    "to_rotation_vector",
]
