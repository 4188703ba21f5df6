#!/usr/bin/env python3
"""Write the seed's four shapes: binary STL bodies (mm) and their shape documents.

    python3 scripts/make_shapes.py [FOLDER]        # default: shapes/

The bodies are closed, as a CAD program exports them; they rest on z = 0, but for the plate,
whose top is z = 0. Vertices of curved
surfaces lie on the surface, so the facets lie inside it. The largest distance between facets
and the true surface is printed. Nothing but Python 3 is needed; the same bytes every time.
"""

import math
import struct
import sys
from pathlib import Path

RADIUS = 50.0
HALF = 50.0
RISE = 50.0
PLATE = 5.0
CYLINDER_SEGMENTS = 250
SPHERE_RINGS = 51  # from the pole to the rim
SPHERE_QUARTER = 51  # segments of a quarter of the rim


def quad(a, b, c, d):
    return [(a, b, c), (a, c, d)]


def fan(ring):
    return [(ring[0], b, c) for b, c in zip(ring[1:], ring[2:])]


def prism(outline, y0, y1):
    """A body between two copies of an outline of (x, z), counter-clockwise seen from -y."""
    front = [(x, y0, z) for x, z in outline]
    back = [(x, y1, z) for x, z in outline]
    triangles = fan(front) + fan(back[::-1])
    for k in range(len(outline)):
        n = (k + 1) % len(outline)
        triangles += quad(front[n], front[k], back[k], back[n])
    return triangles


def flat():
    return prism([(-HALF, -PLATE), (HALF, -PLATE), (HALF, 0.0), (-HALF, 0.0)], -HALF, HALF), 0.0


def wedge():
    return prism([(-HALF, 0.0), (HALF, 0.0), (HALF, RISE)], -HALF, HALF), 0.0


def half_cylinder():
    n = CYLINDER_SEGMENTS
    right = [(RADIUS * math.cos(math.pi * k / n), RADIUS * math.sin(math.pi * k / n))
             for k in range(n // 2)]
    arc = right + [(0.0, RADIUS)] + [(-x, z) for x, z in right[::-1]]
    return prism(arc, -HALF, HALF), RADIUS * (1.0 - math.cos(math.pi / (2 * n)))


def quarter_ring(ring):
    """Azimuths of a quarter of a ring, degrees, both ends included."""
    segments = max(1, round(SPHERE_QUARTER * math.sin(math.pi / 2 * ring / SPHERE_RINGS)))
    azimuths = [90.0 * k / segments for k in range(segments + 1)]
    if ring == SPHERE_RINGS:
        # Points of a regular grid that lie on the rim (3-4-5 triangles) become vertices.
        azimuths += [math.degrees(math.atan2(3, 4)), math.degrees(math.atan2(4, 3))]
    return sorted(azimuths)


def on_sphere(ring, azimuth):
    polar = math.pi / 2 * ring / SPHERE_RINGS
    if ring == 0:
        return (0.0, 0.0, RADIUS)
    rho = RADIUS * math.sin(polar)
    z = 0.0 if ring == SPHERE_RINGS else RADIUS * math.cos(polar)
    if azimuth == 0.0:
        return (rho, 0.0, z)
    if azimuth == 90.0:
        return (0.0, rho, z)
    return (rho * math.cos(math.radians(azimuth)), rho * math.sin(math.radians(azimuth)), z)


def half_sphere():
    quarter = []
    for ring in range(SPHERE_RINGS):
        inner = [on_sphere(ring, a) for a in (quarter_ring(ring) if ring else [0.0])]
        outer = [on_sphere(ring + 1, a) for a in quarter_ring(ring + 1)]
        i = k = 0
        while i + 1 < len(inner) or k + 1 < len(outer):
            # Advance on the side that gives the shorter diagonal.
            to_outer = math.dist(inner[i], outer[k + 1]) if k + 1 < len(outer) else math.inf
            to_inner = math.dist(inner[i + 1], outer[k]) if i + 1 < len(inner) else math.inf
            if to_outer <= to_inner * (1.0 + 1e-9):  # equal ones: the same on any machine
                quarter.append((inner[i], outer[k], outer[k + 1]))
                k += 1
            else:
                quarter.append((inner[i], outer[k], inner[i + 1]))
                i += 1
    rim = [on_sphere(SPHERE_RINGS, a) for a in quarter_ring(SPHERE_RINGS)[:-1]]
    triangles, whole_rim = [], []
    for turn in range(4):
        triangles += [tuple(turned(v, turn) for v in t) for t in quarter]
        whole_rim += [turned(v, turn) for v in rim]
    deviation = max(RADIUS - distance_to_origin(t) for t in quarter)
    return triangles + fan(whole_rim[::-1]), deviation


def turned(vertex, quarters):
    x, y, z = vertex
    for _ in range(quarters):
        x, y = -y, x
    return (x + 0.0, y + 0.0, z)


def distance_to_origin(triangle):
    """Smallest distance of a triangle's points to the origin."""
    normal = cross(minus(triangle[1], triangle[0]), minus(triangle[2], triangle[0]))
    size = dot(normal, normal)
    foot = [n * dot(normal, triangle[0]) / size for n in normal]
    edges = [(triangle[k], triangle[(k + 1) % 3]) for k in range(3)]
    if all(dot(cross(minus(b, a), minus(foot, a)), normal) >= 0.0 for a, b in edges):
        return math.sqrt(dot(foot, foot))
    nearest = []
    for a, b in edges:
        along = minus(b, a)
        t = min(1.0, max(0.0, -dot(a, along) / dot(along, along)))
        nearest.append(math.sqrt(sum((p + t * d) ** 2 for p, d in zip(a, along))))
    return min(nearest)


def minus(a, b):
    return [p - q for p, q in zip(a, b)]


def dot(a, b):
    return sum(p * q for p, q in zip(a, b))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def stl(name, triangles):
    out = bytearray(f"{name}, mm, made by fluxform's make_shapes.py".encode().ljust(80))
    out += struct.pack("<I", len(triangles))
    for triangle in triangles:
        normal = cross(minus(triangle[1], triangle[0]), minus(triangle[2], triangle[0]))
        length = math.sqrt(dot(normal, normal))
        out += struct.pack("<3f", *(n / length + 0.0 for n in normal))
        for vertex in triangle:
            out += struct.pack("<3f", *vertex)
        out += b"\0\0"
    return bytes(out)


POINTS = """
[points]
x_mm = [-50.0, 50.0, 61]
y_mm = [-50.0, 50.0, 61]
outside = "skip"
"""

# name, file, body, height of z = 0 of the body (mm), what the shape is, the exact shape's keys
SHAPES = [
    ("flat", "flat", flat, 50.0, "A plate whose top lies at 50 mm.",
     "side_mm = 100.0\nheight_mm = 50.0\n"),
    ("half-sphere", "half_sphere", half_sphere, 30.0, "Radius 50 mm on a base at 30 mm.",
     "radius_mm = 50.0\nbase_mm = 30.0\n"),
    ("half-cylinder", "half_cylinder", half_cylinder, 30.0,
     "Radius 50 mm, axis along y, on a base at 30 mm.",
     "radius_mm = 50.0\nlength_mm = 100.0\nbase_mm = 30.0\n"),
    ("wedge", "wedge", wedge, 30.0, "Rises with x from 30 mm to 80 mm.",
     "side_mm = 100.0\nlow_mm = 30.0\nhigh_mm = 80.0\n"),
]


def main():
    here = Path(__file__).resolve().parent.parent / "shapes"
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else here
    (folder / "primitives").mkdir(parents=True, exist_ok=True)
    for name, file, body, lift, what, keys in SHAPES:
        triangles, deviation = body()
        data = stl(name, triangles)
        (folder / f"{file}.stl").write_bytes(data)
        (folder / f"{file}.toml").write_bytes((
            f"# {what} Facets within {deviation:.4f} mm of the true surface.\n"
            f'name = "{name}"\nsurface = "{file}.stl"\nunit = "mm"\n'
            f"translate_mm = [0.0, 0.0, {lift}]\n{POINTS}").encode())
        (folder / "primitives" / f"{file}.toml").write_bytes((
            f'# {what} Exact, without a mesh.\nname = "{name}-exact"\n'
            f'primitive = "{name}"\n{keys}{POINTS}').encode())
        print(f"{file}.stl: {len(triangles)} triangles, {len(data)} bytes, "
              f"deviation {deviation:.6f} mm")


if __name__ == "__main__":
    main()
