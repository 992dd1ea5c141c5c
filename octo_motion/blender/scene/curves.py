# SPDX-License-Identifier: GPL-3.0-or-later
"""Curve objects to routes, and the four control points of a route to a curve object.

A route follows what the artist sees. Shape keys, hooks and modifiers that Blender applies to the
control points ("Apply on Spline") move the control points, and the route stays an exact Bézier or
NURBS curve. Where further modifiers bend the drawn line (a lattice, a curve, geometry nodes), the
route goes smoothly through the drawn line's points. Where they, or the curve's own bevel, turn
the line into a surface, the route is the line within.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import bpy
import numpy as np
from numpy.typing import ArrayLike

from ...core.content_cache import ContentCache, content_key
from ...core.errors import RouteError
from ...core.locomotion.path import Route, s_bend
from ...core.phrases import phrase
from ...core.rotations import Floats, normalized
from ..rig import armature_data, world_of

_routes: Final[ContentCache[Route]] = ContentCache(8)

LONGEST: Final = -1
"""Index that stands for the longest spline of a curve."""

_DRAW_ONE: Final = "Choose a curve (Add › Curve), or add an octopus route."
_ADD_POINTS: Final = "Give the curve at least two points that lie apart."
_MOVES_CONTROL_POINTS: Final = {"HOOK", "SOFT_BODY", "MESH_DEFORM"}
"""Modifiers that move control points without being asked to."""
_DISPLAY_RESOLUTION: Final = 32
"""Pieces in which Blender draws a new route's one segment, for the eye alone: routes are exact."""
_REACH: Final = 1.0
"""Metres from the middle of a creature to its arms' tips where there is none to measure."""


def read_route(
    curve: bpy.types.Object,
    depsgraph: bpy.types.Depsgraph | None = None,
    spline_index: int = LONGEST,
) -> Route:
    """The route that a curve object describes, in world space and metres.

    The curve may be of any spline types, open or cyclic, in any mode, hidden or not. Of its splines
    the longest that can be followed is taken, if no other is asked for.

    Raises:
        RouteError: the object is no curve, or has no spline that can be followed.
    """
    _check_type(curve)
    if curve.mode == "EDIT":
        curve.update_from_editmode()
    if depsgraph is None:
        depsgraph = bpy.context.evaluated_depsgraph_get()
    evaluated = curve.evaluated_get(depsgraph)
    lines = _drawn_lines(evaluated) if _is_bent_after_its_points(evaluated) else None
    if lines is None:
        lines = _splines(evaluated, depsgraph)
    world = np.array(world_of(curve, depsgraph), dtype=np.float64)
    if spline_index == LONGEST:
        return _longest(lines, world, curve.name)
    if not 0 <= spline_index < len(lines):
        raise RouteError(
            phrase(
                "The curve '{curve}' has {count} splines; number {number} is none of them.",
                curve=curve.name,
                count=len(lines),
                number=spline_index,
            ),
            "Numbers start at 0; -1 takes the longest.",
        )
    return lines[spline_index].route(world)


def add_route_curve(
    name: str, control_points: ArrayLike, collection: bpy.types.Collection
) -> bpy.types.Object:
    """A new curve object: one cubic Bézier segment of control points (4, 3), world, the route of
    [Octopus] §3.5.

    Its origin is the first control point, so that moving the object moves the start.
    """
    world = np.asarray(control_points, dtype=np.float64)
    points = world - world[0]
    data = bpy.data.curves.new(name, "CURVE")
    data.dimensions = "3D"
    data.resolution_u = _DISPLAY_RESOLUTION
    spline = data.splines.new("BEZIER")
    spline.bezier_points.add(1)
    # The outer handles do nothing; mirrored, they let the artist extrude the curve further.
    handles = [(2 * points[0] - points[1], points[1]), (points[2], 2 * points[3] - points[2])]
    for point, place, (left, right) in zip(
        spline.bezier_points, (points[0], points[3]), handles, strict=True
    ):
        point.handle_left_type = point.handle_right_type = "FREE"
        point.co, point.handle_left, point.handle_right = place, left, right
    route = bpy.data.objects.new(name, data)
    route.location = world[0]
    # On hilly ground a walk is above or below its route, which is to be seen within the hills, too.
    route.show_in_front = True
    collection.objects.link(route)
    return route


def suggested_control_points(
    armature: bpy.types.Object | None, context: bpy.types.Context
) -> Floats:
    """Control points (4, 3) in world space of a route for a creature that has none yet.

    It starts where the creature stands, leaves the way its front faces and is as long as suits
    its size. Without a creature it starts at the 3D cursor, towards −Y.
    """
    if armature is None:
        return s_bend(np.array(context.scene.cursor.location), [0.0, -1.0, 0.0], _REACH)
    context.view_layer.update()
    world = np.array(armature.matrix_world, dtype=np.float64)
    level = -world[:3, 1] * [1.0, 1.0, 0.0]
    front = level if np.any(normalized(level)) else [0.0, -1.0, 0.0]
    bones = armature_data(armature).bones
    ends = [end for bone in bones for end in (bone.head_local, bone.tail_local)]
    places = np.array(ends, dtype=np.float64).reshape(-1, 3) @ world[:3, :3].T
    reach = 0.5 * float(np.max(np.ptp(places, axis=0))) if len(places) else 0.0
    return s_bend(world[:3, 3], front, reach or _REACH)


@dataclass(frozen=True)
class _Line:
    """One spline, or one drawn line, in the object's own space."""

    kind: str
    points: Floats
    """(n, 3), or (n, 3, 3) for Bézier: handle, point, handle."""
    cyclic: bool
    weights: Floats | None = None
    order: int = 0
    knots: Floats | None = None

    def route(self, world: Floats) -> Route:
        """The same in the world; what was worked out of the same one before stays with it."""
        return _routes.get(content_key(self, world), lambda: self._route(world))

    def _route(self, world: Floats) -> Route:
        moved = self.points @ world[:3, :3].T + world[:3, 3]
        if self.kind == "BEZIER":
            return Route.bezier(_bezier_segments(moved, self.cyclic), cyclic=self.cyclic)
        if self.kind == "SMOOTH":
            return Route.bezier(_smooth_segments(moved, self.cyclic), cyclic=self.cyclic)
        if self.weights is None or self.knots is None:
            return Route.poly(moved, cyclic=self.cyclic)
        return Route.nurbs(moved, self.weights, self.order, self.knots, cyclic=self.cyclic)


def _check_type(curve: bpy.types.Object) -> None:
    if curve.type == "CURVE":
        return
    if curve.type == "CURVES":
        raise RouteError(
            phrase("'{curve}' is a hair curves object, which cannot be a route.", curve=curve.name),
            "Convert it to a mesh, and the mesh to a curve (Object › Convert).",
        )
    kind = curve.type.replace("_", " ").lower()
    raise RouteError(
        phrase("'{curve}' is not a curve but of type {kind}.", curve=curve.name, kind=kind),
        _DRAW_ONE,
    )


def _longest(lines: Sequence[_Line], world: Floats, name: str) -> Route:
    best: Route | None = None
    reason: RouteError | None = None
    for line in lines:
        try:
            route = line.route(world)
        except RouteError as error:
            reason = error
            continue
        if best is None or route.length > best.length:
            best = route
    if best is None:
        raise reason or RouteError(
            phrase("The curve '{name}' has no splines.", name=name), _ADD_POINTS
        )
    return best


# --- splines -------------------------------------------------------------------------------------


def _splines(evaluated: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> list[_Line]:
    """The curve's splines, their points moved by shape keys, hooks and the like."""
    try:
        curve = evaluated.to_curve(depsgraph, apply_modifiers=True)
        return [_spline(each) for each in curve.splines]
    finally:
        evaluated.to_curve_clear()


def _spline(spline: bpy.types.Spline) -> _Line:
    cyclic = spline.use_cyclic_u
    if spline.type == "BEZIER":
        points = spline.bezier_points
        columns = [
            _vectors(points, attribute, 3) for attribute in ("handle_left", "co", "handle_right")
        ]
        return _Line("BEZIER", np.stack(columns, axis=1), cyclic)
    homogeneous = _vectors(spline.points, "co", 4)
    points, weights = homogeneous[:, :3], homogeneous[:, 3]
    if spline.type == "NURBS" and _has_nurbs_shape(spline):
        order = spline.order_u
        wrap = order - 1 if cyclic else 0
        around = np.arange(len(points) + wrap) % len(points)
        knots = _knots(len(points), spline)
        return _Line("NURBS", points[around], cyclic, weights[around], order, knots)
    # Blender, too, draws a line through the points of a NURBS spline that it cannot evaluate.
    return _Line("POLY", points, cyclic and len(points) > 2)


def _vectors(points: bpy.types.bpy_prop_collection[Any], attribute: str, size: int) -> Floats:
    flat = np.empty(size * len(points), dtype=np.float32)
    points.foreach_get(attribute, flat)
    return flat.reshape(-1, size).astype(np.float64)


def _has_nurbs_shape(spline: bpy.types.Spline) -> bool:
    """Whether there are points enough for the order, and for whole segments of a Bézier kind."""
    count, order = len(spline.points), spline.order_u
    if count < order:
        return False
    if not spline.use_bezier_u:
        return True
    if count == order and not spline.use_endpoint_u:
        return False
    return not spline.use_cyclic_u or count % (order - 1) == 0


def _knots(count: int, spline: bpy.types.Spline) -> Floats:
    """The knots that Blender gives a NURBS spline of ``count`` points.

    They are whole numbers in groups of equal ones. A Bézier kind repeats each as often as the
    degree; "endpoint" repeats the first as often as the order, so that the curve starts on its
    first point. A cyclic spline has ``order − 1`` knots more, for the points that it repeats, and
    ends with the pattern of its start.
    """
    order = spline.order_u
    cyclic, endpoint, bezier = spline.use_cyclic_u, spline.use_endpoint_u, spline.use_bezier_u
    inner = order - 1 if bezier else 1
    clamped = [1, order - 1] if cyclic else [order]
    first = clamped if endpoint else [min(2, inner)]
    groups = first + [inner] * (count + 2 * order)
    endless = np.repeat(np.arange(len(groups)), groups)
    tail = 2 * order - 1 if cyclic else (order if endpoint else 0)
    head = count + order + (order - 1 if cyclic else 0) - tail
    knots = endless[:head].tolist()
    for position in range(tail):
        knots.append(endless[head] + knots[position] - knots[0])
    return np.array(knots, dtype=np.float64)


def _bezier_segments(points: Floats, cyclic: bool) -> Floats:  # noqa: FBT001
    """Control points (segments, 4, 3) of handles and points (n, 3, 3)."""
    following = np.roll(points, -1, axis=0)
    segments = np.stack([points[:, 1], points[:, 2], following[:, 0], following[:, 1]], axis=1)
    return segments if cyclic else segments[:-1]


# --- lines as drawn ------------------------------------------------------------------------------


def _is_bent_after_its_points(curve: bpy.types.Object) -> bool:
    """Whether a modifier acts on the drawn line, which its control points do not show."""
    bent = False
    for modifier in curve.modifiers:
        if modifier.show_viewport:
            on_points = modifier.type in _MOVES_CONTROL_POINTS or modifier.use_apply_on_spline
            # Blender applies all modifiers up to the last such one to the control points.
            bent = not on_points
    return bent


def _drawn_lines(evaluated: bpy.types.Object) -> list[_Line] | None:
    """The lines that Blender draws for the curve, or nothing if it draws something else."""
    if not evaluated.is_evaluated:
        return None
    try:
        mesh = evaluated.to_mesh()
        if mesh is None or len(mesh.polygons) > 0 or len(mesh.edges) == 0:
            return None
        points = _vectors(mesh.vertices, "co", 3)
        ends = np.empty(2 * len(mesh.edges), dtype=np.int32)
        mesh.edges.foreach_get("vertices", ends)
    finally:
        evaluated.to_mesh_clear()
    chains = _chains(len(points), ends.reshape(-1, 2))
    if chains is None:
        return None
    return [_Line("SMOOTH", points[chain], cyclic) for chain, cyclic in chains]


def _chains(count: int, edges: np.ndarray) -> list[tuple[list[int], bool]] | None:
    """Edges (n, 2) joined to chains of vertices, each open or closed; nothing if some branch."""
    neighbours: list[list[int]] = [[] for _ in range(count)]
    for a, b in edges.tolist():
        neighbours[a].append(b)
        neighbours[b].append(a)
    if any(len(each) > 2 for each in neighbours):
        return None
    chains = []
    seen = [False] * count
    # Open chains are found from their ends, in the order of their first vertices; what is left
    # then is closed.
    starts = [v for v in range(count) if len(neighbours[v]) == 1] + list(range(count))
    for start in starts:
        if seen[start] or not neighbours[start]:
            continue
        chain, here = [], start
        while here is not None:
            seen[here] = True
            chain.append(here)
            here = next((v for v in neighbours[here] if not seen[v]), None)
        chains.append((chain, len(neighbours[start]) == 2))
    return sorted(chains, key=lambda chain: min(chain[0]))


def _smooth_segments(points: Floats, cyclic: bool) -> Floats:  # noqa: FBT001
    """Bézier segments (n, 4, 3) through points (n, 3), smooth at each of them.

    The direction at a point is that of the parabola through it and its neighbours, which points
    at uneven distances do not sway.
    """
    moves = np.any(points != np.roll(points, 1, axis=0), axis=-1)
    # An open line may come back to where it started.
    moves[:1] |= not cyclic
    points = points[moves]
    if len(points) < 3:
        return np.stack([points[:-1], points[:-1], points[1:], points[1:]], axis=1)
    before, after = np.roll(points, 1, axis=0), np.roll(points, -1, axis=0)
    if not cyclic:
        before[0] = 2.0 * points[0] - points[1]
        after[-1] = 2.0 * points[-1] - points[-2]
    into = np.linalg.norm(points - before, axis=-1)[:, None]
    out = np.linalg.norm(after - points, axis=-1)[:, None]
    slope = ((points - before) / into * out + (after - points) / out * into) / (into + out)
    handles = np.stack([points - slope * into / 3.0, points, points + slope * out / 3.0], axis=1)
    return _bezier_segments(handles, cyclic)
