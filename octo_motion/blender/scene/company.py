# SPDX-License-Identifier: GPL-3.0-or-later
"""A puppet with what is simulated beside it: figures of other armatures, and loose objects.

Its bodies come first, so that numbers of bodies mean the same with company and without.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ...core.errors import RigError
from ...core.phrases import phrase
from ...core.posing.puppet import Figure, Pose, joined, joined_poses, resized
from ...core.posing.solver import Obstacle
from ..rig import Puppet, PuppetRig
from .loose_objects import LooseObject


@dataclass(frozen=True, eq=False)
class Partner:
    """Another armature's puppet, in the units of the first."""

    puppet: Puppet
    share: float
    """How much longer a metre is in the first one's units."""

    def read(self) -> Pose:
        return self.seen(self.puppet.read())

    def seen(self, pose: Pose) -> Pose:
        """Its own pose in the first one's units."""
        return Pose(pose.positions * self.share, pose.orientations)

    def own(self, pose: Pose) -> Pose:
        """The other way."""
        return Pose(pose.positions / self.share, pose.orientations)


class Company:
    """The puppets and things of one session; it is used as the first puppet is."""

    def __init__(
        self,
        puppet: Puppet,
        partners: Sequence[Puppet] = (),
        things: Sequence[LooseObject] = (),
    ) -> None:
        self.main = puppet
        unit = puppet.rig.unit
        self.partners = tuple(Partner(each, unit / each.rig.unit) for each in partners)
        self.things = tuple(things)
        others = [_named(each) for each in self.partners]
        self.figure: Figure = joined([puppet.figure, *others, *(each.figure for each in things)])
        self.pose = joined_poses(
            [
                puppet.rig.pose,
                *(each.seen(each.puppet.rig.pose) for each in self.partners),
                *(each.pose for each in things),
            ]
        )
        """As all stood at the start, puppet metres."""
        counts = [len(puppet.figure), *map(len, others), *(1 for _ in things)]
        ends = np.cumsum(counts).tolist()
        self._spans = [range(end - count, end) for end, count in zip(ends, counts, strict=True)]

    # --- Who is who -----------------------------------------------------------------------------

    @property
    def name(self) -> str:
        return self.main.name

    @property
    def rig(self) -> PuppetRig:
        """The puppet's own."""
        return self.main.rig

    def armatures(self) -> list[bpy.types.Object]:
        """All armature objects, whatever their bones are by now.

        Raises:
            RigError: one is gone.
        """
        return [puppet.found() for puppet in self._puppets()]

    @property
    def alone(self) -> bool:
        """Whether there is nothing beside the puppet."""
        return len(self._spans) == 1

    @property
    def own(self) -> range:
        """Bodies of the puppet itself."""
        return self._spans[0]

    def partners_with(self) -> Iterator[tuple[Partner, range]]:
        """Other puppets, and which bodies are theirs."""
        return zip(self.partners, self._spans[1:], strict=False)

    def things_with(self) -> Iterator[tuple[LooseObject, int]]:
        """Loose objects, and the body of each."""
        spans = self._spans[1 + len(self.partners) :]
        return ((thing, span[0]) for thing, span in zip(self.things, spans, strict=True))

    def shapes(self) -> list[Obstacle]:
        """Shapes of bodies that are no capsules."""
        found = (thing.shape(body) for thing, body in self.things_with())
        return [each for each in found if each is not None]

    def body(self, name: str) -> int:
        """The body of a bone, of another armature's bone as "armature: bone", or of a thing.

        Raises:
            RigError: there is none, or it follows nothing.
        """
        if name not in self.main.rig.skeleton.index:
            for thing, body in self.things_with():
                if name == thing.name:
                    return body
            for partner, span in self.partners_with():
                begins = f"{partner.puppet.name}: "
                if name.startswith(begins):
                    puppet = partner.puppet
                    return span[0] + puppet.rig.body(name.removeprefix(begins), puppet.name)
        return self.main.rig.body(name, self.main.name)

    # --- As one puppet --------------------------------------------------------------------------

    def armature(self) -> bpy.types.Object:
        """The first armature object, as it is now; all others are looked at as well.

        Raises:
            RigError: one is gone, or its bones are others.
        """
        for partner in self.partners:
            partner.puppet.armature()
        return self.main.armature()

    def read(self) -> Pose:
        """Where all bodies are, as Blender shows them now."""
        return joined_poses(
            [
                self.main.read(),
                *(each.read() for each in self.partners),
                *(each.read() for each in self.things),
            ]
        )

    def write(self, pose: Pose) -> list[str]:
        """Give bones and objects the pose; the names of those whose values have changed."""
        changed = self.main.write(part_of_pose(pose, self.own))
        for partner, span in self.partners_with():
            changed += partner.puppet.write(partner.own(part_of_pose(pose, span)))
        for thing, body in self.things_with():
            if thing.write(part_of_pose(pose, range(body, body + 1))):
                changed.append(thing.name)
        return changed

    def forget(self) -> None:
        """Something else has posed the armatures: the next pose is written whole."""
        for puppet in self._puppets():
            puppet.forget()

    def is_moved(self) -> bool:
        """Whether an armature object has been moved since ``forget``, or the start."""
        return any(puppet.is_moved() for puppet in self._puppets())

    def settle(self) -> str:
        """See to it that the bones show the pose that was written; what cannot be, in words."""
        return "  ".join(filter(None, [puppet.settle() for puppet in self._puppets()]))

    def shown_for(self, pose: Pose) -> Pose | None:
        """What is shown in place of a pose that was settled and could not be; none where it is."""
        parts = [part_of_pose(pose, span) for span in self._spans]
        found = [self.main.shown_for(parts[0])]
        for part, partner in zip(parts[1:], self.partners, strict=False):
            shown = partner.puppet.shown_for(partner.own(part))
            found.append(None if shown is None else partner.seen(shown))
        if all(each is None for each in found):
            return None
        found += [None] * len(self.things)
        return joined_poses(
            [other if one is None else one for one, other in zip(found, parts, strict=True)]
        )

    def with_followers(self, bodies: Iterable[int]) -> list[int]:
        """Bodies that were turned, and those whose bones have other values because of it."""
        turned = set(bodies)
        found = {each for each in turned if each >= len(self.figure) - len(self.things)}
        for puppet, span in zip(self._puppets(), self._spans, strict=False):
            own = puppet.with_followers(each - span[0] for each in turned if each in span)
            found |= {span[0] + each for each in own}
        return sorted(found)

    def _puppets(self) -> Iterator[Puppet]:
        yield self.main
        yield from (each.puppet for each in self.partners)


def _named(partner: Partner) -> Figure:
    """A partner's figure in the first one's units, its bodies named after their armature too."""
    puppet = partner.puppet
    figure = resized(puppet.figure, partner.share)
    return replace(figure, names=tuple(f"{puppet.name}: {each}" for each in figure.names))


def check_partner(armature: bpy.types.Object, others: Iterable[bpy.types.Object]) -> None:
    """See that an armature is none of those that are there already.

    Raises:
        RigError: it is.
    """
    if armature in others:
        raise RigError(
            phrase("'{armature}' is there twice.", armature=armature.name),
            "Name each armature once.",
        )


def part_of_pose(pose: Pose, bodies: range) -> Pose:
    """Of some bodies."""
    which = slice(bodies.start, bodies.stop)
    return Pose(pose.positions[which], pose.orientations[which])
