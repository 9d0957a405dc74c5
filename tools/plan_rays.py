"""Rays and solids in a scene that Blender holds, for `check_plan.py`: random walks of light, closed skins, what is inside of them.

Rays are cast by `mathutils.bvhtree`, edges and windings are told by `bmesh`.
"""

import bmesh
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from plan_scene import CLEAR, FULL

FRONT, BACK = 0, 1
# Vertices of a thing that are asked whether they are inside of another.
PROBES = 64


class Rays:
    """Random points of sides, and what can be seen from there."""

    def __init__(self, scene):
        self.scene = scene
        solid = [part for part in scene.parts if part.opacity != CLEAR]
        corners = np.concatenate([part.corners for part in solid]) if solid else np.zeros((0, 3, 3))
        self.normals = np.concatenate([part.normals for part in solid]) if solid else np.zeros((0, 3))
        self.owner = [part for part in solid for _ in part.corners]
        self.middle = (
            (corners.reshape(-1, 3).min(axis=0) + corners.reshape(-1, 3).max(axis=0)) / 2 if len(corners) else np.zeros(3)
        )
        flat = corners.reshape(-1, 3) - self.middle
        self.size = float(np.abs(flat).max()) if len(flat) else 1.0
        self.near = 1e-5 * self.size
        self.tree = (
            BVHTree.FromPolygons(flat.tolist(), np.arange(len(flat)).reshape(-1, 3).tolist(), all_triangles=True)
            if len(flat)
            else None
        )
        self.numbers = np.random.default_rng(1)
        self.sent = 0

    def cast(self, at, way, far=np.inf):
        """What is hit: (part, side, point, normal of that side, distance), or None."""
        if self.tree is None:
            return None
        self.sent += 1
        far = min(far, 8 * self.size)
        point, _, index, distance = self.tree.ray_cast(Vector(at - self.middle), Vector(way), far)
        if index is None:
            return None
        normal = self.normals[index]
        side = FRONT if normal @ way < 0 else BACK
        return (
            self.owner[index],
            side,
            np.array(point, dtype=np.float64) + self.middle,
            normal if side == FRONT else -normal,
            distance,
        )

    def is_touched(self, at, part):
        """Whether another object lies on this point of a part: which of the two a ray meets there is chance."""
        found = self.tree.find_nearest_range(Vector(at - self.middle), 2 * self.near) if self.tree else []
        return any(self.owner[index].thing is not part.thing for _, _, index, _ in found)

    def escapes(self, at, way):
        """Whether a ray leaves the scene, and its neighbours too: between triangles that touch, single rays may slip."""
        if self.cast(at, way) is not None:
            return False
        return all(self.cast(at, way + 1e-3 * self.numbers.normal(size=3)) is None for _ in range(3))

    def samples(self, part, side, count):
        """Points just above a side, with the side's normals."""
        if part.areas.sum() <= 0:
            return
        which = self.numbers.choice(len(part.areas), size=count, p=part.areas / part.areas.sum())
        for triangle in which:
            at, normal = self.sample(part, side, triangle)
            if not self.is_touched(at - self.near * normal, part):
                yield at, normal

    def sample(self, part, side, triangle):
        s, t = np.sqrt(self.numbers.random()), self.numbers.random()
        a, b, c = part.corners[triangle]
        normal = part.normals[triangle] * (1 if side == FRONT else -1)
        inner = 0.02 / 3 + 0.98 * np.array([1 - s, s * (1 - t), s * t])
        return inner @ np.array([a, b, c]) + self.near * normal, normal

    def around(self, normal):
        """A random direction, as often as its cosine."""
        way = self.numbers.normal(size=3)
        way = way / np.linalg.norm(way) + normal * (1 + 1e-6)
        return way / np.linalg.norm(way)

    def sees_lamp(self, at, normal, lamp):
        """Whether a lamp is in front and nothing opaque in the way."""
        found = lamp.towards(at)
        if found is None or found[0] @ normal <= 1e-3:
            return False
        way, distance = found
        hit = self.cast(at, way, distance - self.near)
        while hit and hit[0].opacity != FULL:
            distance -= hit[4] + self.near
            at = hit[2] + self.near * way
            hit = self.cast(at, way, distance) if distance > self.near else None
        return hit is None

    def walk(self, at, normal, bounces):
        """The sides that a random walk meets; at last None, should it leave the scene. It may pass what is not opaque, and
        says nothing of where objects touch."""
        for _ in range(bounces):
            way = self.around(normal)
            hit = self.cast(at, way)
            while hit and hit[0].opacity != FULL and not self.is_touched(hit[2], hit[0]) and self.numbers.random() < 0.5:
                hit = self.cast(hit[2] + self.near * way, way)
            if hit is None:
                if self.escapes(at, way):
                    yield None
                return
            if not self.is_touched(hit[2], hit[0]):
                yield hit
            at, normal = hit[2] + self.near * hit[3], hit[3]


# ---- solids -------------------------------------------------------------------------------------------------------


class Skin:
    """A connected component of an object, joined where positions are the same to the bit."""

    def __init__(self, thing, triangles, open_edges, tangled, opaque):
        self.thing, self.triangles, self.opaque = thing, triangles, opaque
        self.open_edges, self.tangled = open_edges, tangled
        self.closed = not open_edges and not tangled
        corners = thing.local[triangles]
        a, b, c = (corners - corners[0, 0]).transpose(1, 0, 2)
        self.volume = float(np.einsum("ij,ij->i", np.cross(b, c), a).sum() / 6)
        self.tree = None

    def holds(self, points):
        """Whether some points are inside and none outside; what lies on the skin itself is neither."""
        corners = self.thing.world[self.triangles]
        low, high = corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)
        middle, size = (low + high) / 2, np.linalg.norm(high - low)
        if (points < low - 1e-5 * size).any() or (points > high + 1e-5 * size).any():
            return False
        if self.tree is None:
            flat = (corners.reshape(-1, 3) - middle).tolist()
            self.tree = BVHTree.FromPolygons(flat, np.arange(len(flat)).reshape(-1, 3).tolist(), all_triangles=True)
        found = False
        for point in points - middle:
            _, _, index, distance = self.tree.find_nearest(Vector(point))
            if index is None or distance < 2e-6 * size:
                continue
            if (
                sum(
                    self.crossings(point, Vector(way), size) % 2
                    for way in ((0.36, 0.48, 0.8), (-0.6, 0.64, -0.48), (0.1, -0.7, 0.7))
                )
                < 2
            ):
                return False
            found = True
        return found

    def crossings(self, point, way, size):
        at, count = Vector(point), 0
        while count < 1000:
            hit, _, index, _ = self.tree.ray_cast(at, way)
            if index is None:
                break
            at, count = hit + way * (1e-6 * size), count + 1
        return count


def skins(thing):
    """The components of an object."""
    if thing.skins is not None:
        return thing.skins
    count = len(thing.local)
    _, names = np.unique(thing.local.reshape(-1, 3) + 0.0, axis=0, return_inverse=True)
    names = names.reshape(-1, 3)
    shape = bmesh.new()
    vertices = [shape.verts.new() for _ in range(names.max(initial=-1) + 1)]
    twice, faces = set(), {}
    for triangle in range(count):
        corners = names[triangle]
        if len(set(corners.tolist())) < 3:
            continue
        try:
            faces[triangle] = shape.faces.new([vertices[name] for name in corners])
        except ValueError:  # Blender holds a face only once
            twice.add(tuple(sorted(corners.tolist())))
    shape.faces.index_update()
    of_face = {face.index: triangle for triangle, face in faces.items()}
    known, thing.skins = set(), []
    for first in faces.values():
        if first.index in known:
            continue
        waiting, members, edges = [first], [], set()
        known.add(first.index)
        while waiting:
            face = waiting.pop()
            members.append(of_face[face.index])
            for edge in face.edges:
                edges.add(edge)
                for other in edge.link_faces:
                    if other.index not in known:
                        known.add(other.index)
                        waiting.append(other)
        members = np.array(sorted(members))
        open_edges = sum(edge.is_boundary for edge in edges)
        tangled = any(len(edge.link_faces) > 2 or len(edge.link_faces) == 2 and not edge.is_contiguous for edge in edges)
        tangled |= any(tuple(sorted(names[member].tolist())) in twice for member in members)
        opaque = all(
            part.opacity == FULL and not part.look.may_be_glass for part in {id(p): p for p in thing.part_of[members]}.values()
        )
        thing.skins.append(Skin(thing, members, open_edges, tangled, opaque))
    shape.free()
    return thing.skins


def inside(scene, skin):
    """The name of something that is wholly inside of a closed skin, lamps first."""
    for lamp in scene.lamps:
        if lamp.kind != "SUN" and skin.holds(lamp.at[None]):
            return lamp.name
    for other in scene.things:
        for component in skins(other):
            if component is not skin:
                points = np.unique(other.world[component.triangles].reshape(-1, 3), axis=0)
                if skin.holds(points[:: max(1, len(points) // PROBES)]):
                    return other.name
    return None
