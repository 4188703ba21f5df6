#!/usr/bin/env python3
"""Convert a STEP file to a binary STL in millimetres with OpenCASCADE.

    pip install cadquery-ocp
    scripts/step_to_stl.py part.step part.stl [--chord 0.01]

For STEP files that `fluxform` refuses. The bodies are meshed to a chord of so many millimetres.
As a cross-check the mesh's volume is compared with that of the exact bodies; the script fails if
they differ by more than the chord times the area allows, and so are the boxes. Use the result with `--unit mm`.
"""

import argparse
import pathlib
import struct
import sys

from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Tool
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepGProp import BRepGProp
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.GProp import GProp_GProps
from OCP.IFSelect import IFSelect_RetDone
from OCP.STEPControl import STEPControl_Reader
from OCP.TopAbs import TopAbs_FACE, TopAbs_REVERSED
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS


def static(owner, name):
    """A static method under its name of this or of an earlier version of OCP."""
    return getattr(owner, name, None) or getattr(owner, name + "_s")


def load(path):
    """The bodies of a STEP file as one shape, in millimetres."""
    reader = STEPControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_RetDone:
        sys.exit(f"{path}: OpenCASCADE cannot read this file")
    reader.TransferRoots()
    shape = reader.OneShape()
    if shape.IsNull():
        sys.exit(f"{path}: the file holds no shape")
    return shape


def triangles(shape, chord_mm):
    """The triangles of all faces, outward normals."""
    BRepMesh_IncrementalMesh(shape, chord_mm, False, 0.3, False)
    faces = TopExp_Explorer(shape, TopAbs_FACE)
    as_face = static(TopoDS, "Face")
    mesh_of = static(BRep_Tool, "Triangulation")
    found = []
    while faces.More():
        face = as_face(faces.Current())
        place = TopLoc_Location()
        mesh = mesh_of(face, place)
        faces.Next()
        if mesh is None:
            sys.exit("a face could not be meshed")
        move = place.Transformation()
        points = []
        for i in range(1, mesh.NbNodes() + 1):
            p = mesh.Node(i).Transformed(move)
            points.append((p.X(), p.Y(), p.Z()))
        for i in range(1, mesh.NbTriangles() + 1):
            a, b, c = mesh.Triangle(i).Get()
            if face.Orientation() == TopAbs_REVERSED:
                b, c = c, b
            found.append((points[a - 1], points[b - 1], points[c - 1]))
    return found


def volume(mesh):
    """The signed volume that the triangles enclose."""
    total = 0.0
    for a, b, c in mesh:
        total += a[0] * (b[1] * c[2] - b[2] * c[1])
        total += a[1] * (b[2] * c[0] - b[0] * c[2])
        total += a[2] * (b[0] * c[1] - b[1] * c[0])
    return total / 6.0


def check(shape, mesh, chord_mm):
    """Hold the mesh against the exact bodies."""
    solid, skin = GProp_GProps(), GProp_GProps()
    static(BRepGProp, "VolumeProperties")(shape, solid)
    static(BRepGProp, "SurfaceProperties")(shape, skin)
    exact, meshed = solid.Mass(), volume(mesh)
    most = chord_mm * skin.Mass() + 1e-6 * abs(exact)
    print(f"volume: exact {exact:.6g} mm^3, mesh {meshed:.6g} mm^3 (may differ by {most:.3g})")
    if abs(exact - meshed) > most:
        sys.exit("the mesh's volume is not that of the bodies: nothing is written")
    box = Bnd_Box()
    static(BRepBndLib, "AddOptimal")(shape, box, False, False)
    corners = [box.CornerMin(), box.CornerMax()]
    exact_box = [c for p in corners for c in (p.X(), p.Y(), p.Z())]
    columns = list(zip(*(point for triangle in mesh for point in triangle)))
    mesh_box = [min(column) for column in columns] + [max(column) for column in columns]
    print("box of the exact bodies, mm:", " ".join(f"{c:.6g}" for c in exact_box))
    print("box of the mesh, mm:        ", " ".join(f"{c:.6g}" for c in mesh_box))
    if any(abs(a - b) > 2 * chord_mm for a, b in zip(exact_box, mesh_box)):
        sys.exit("the mesh's box is not that of the bodies: nothing is written")


def write(path, mesh):
    """Binary STL; normals are left zero, since no reader should trust them."""
    with open(path, "wb") as out:
        out.write(b"millimetres, from STEP by OpenCASCADE".ljust(80))
        out.write(struct.pack("<I", len(mesh)))
        for a, b, c in mesh:
            out.write(struct.pack("<12fH", 0, 0, 0, *a, *b, *c, 0))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("step", type=pathlib.Path)
    parser.add_argument("stl", type=pathlib.Path)
    parser.add_argument("--chord", type=float, default=0.01, help="chord of the mesh, mm")
    arguments = parser.parse_args()
    shape = load(arguments.step)
    mesh = triangles(shape, arguments.chord)
    if not mesh:
        sys.exit(f"{arguments.step}: the file holds no face")
    check(shape, mesh, arguments.chord)
    write(arguments.stl, mesh)
    print(f"{arguments.stl}: {len(mesh)} triangles, to be read with --unit mm")


if __name__ == "__main__":
    main()
