# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms of as many bones each, from their bones to their joints and back, all of them at once.

The same as ``ArmFrames`` says of one arm, without its frames: each bone's orientation tells where
its segment points. Components come first and the batch last, as in ``rotations.components_first``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...rotations import Floats, components_first
from ...rotations.components_first import cumulative_sum
from .arm_frames import ArmFrames


@dataclass(frozen=True, eq=False)
class ArmBatch:
    """Arms of as many bones each; the batch is any of them, at any moments."""

    roots: Floats
    """(3, arms) P₀ at rest, armature space."""
    lengths: Floats
    """(bones, arms) of the segments, armature units."""
    segments: Floats
    """(bones, 3, arms) unit vectors along the segments, in the bones' rest frames."""
    carried: Floats
    """(bones, 4, arms) each bone's rest orientation as the bone before sees it."""
    follows: np.ndarray
    """(bones, arms) whether the bone before turns this one."""

    @classmethod
    def of(cls, arms: Sequence[ArmFrames]) -> ArmBatch:
        """Some arms, all of as many bones."""
        return cls(
            np.stack([arm.root for arm in arms], axis=-1),
            np.stack([arm.lengths for arm in arms], axis=-1),
            np.stack([arm.rest.segments for arm in arms], axis=-1),
            np.stack([arm.rest.carried for arm in arms], axis=-1),
            np.stack([np.array(arm.rest.follows) for arm in arms], axis=-1),
        )

    def orientations(self, rotations: Floats, arm: np.ndarray) -> Floats:
        """Orientations (bones, 4, batch) in armature space.

        Args:
            rotations: (bones, 4, batch) in each bone's rest frame.
            arm: (batch,) which of the arms each one is.
        """
        result = np.empty(rotations.shape)
        for bone, own in enumerate(rotations):
            before = result[bone - 1] if bone else None
            result[bone] = components_first.multiply(self._carried(bone, arm, before), own)
        return result

    def rotations(self, orientations: Floats, arm: np.ndarray) -> Floats:
        """Inverse of :meth:`orientations`."""
        result = np.empty(orientations.shape)
        for bone, own in enumerate(orientations):
            before = orientations[bone - 1] if bone else None
            back = self._carried(bone, arm, before)
            back[1:] *= -1.0
            result[bone] = components_first.multiply(back, own)
        return result

    def _carried(self, bone: int, arm: np.ndarray, before: Floats | None) -> Floats:
        """Where a bone (4, batch) is when it is not turned, in armature space.

        Args:
            bone: its number.
            arm: (batch,) which of the arms each one is.
            before: (4, batch) the orientation of the bone before.
        """
        carried = self.carried[bone][:, arm]
        follows = self.follows[bone]
        if before is None or not follows.any():
            # Of those that follow nothing it is in armature space already.
            return carried
        taken = components_first.multiply(before, carried)
        return taken if follows.all() else np.where(follows[arm], taken, carried)

    def joints(self, orientations: Floats, arm: np.ndarray, strains: Floats) -> Floats:
        """Joints P₀ … Pₙ (bones + 1, 3, batch) in armature space.

        Args:
            orientations: (bones, 4, batch)
            arm: (batch,) which of the arms each one is.
            strains: (bones, batch) by how much bones are longer than at rest, as a share.
        """
        result = np.empty((len(orientations) + 1, 3, orientations.shape[2]))
        result[0] = self.roots[:, arm]
        lengths = self.lengths[:, arm] * (1.0 + strains)
        for bone, own in enumerate(orientations):
            along = components_first.rotate(own, self.segments[bone][:, arm])
            np.multiply(along, lengths[bone], out=result[bone + 1])
        return cumulative_sum(result)


def batches_by_bones(arms: Sequence[ArmFrames]) -> list[tuple[list[int], ArmBatch]]:
    """Arms, and their numbers, by how many bones they have."""
    by_bones: dict[int, list[int]] = {}
    for number, arm in enumerate(arms):
        by_bones.setdefault(len(arm.bones), []).append(number)
    return [
        (numbers, ArmBatch.of([arms[number] for number in numbers]))
        for numbers in by_bones.values()
    ]
