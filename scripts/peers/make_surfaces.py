#!/usr/bin/env python3
"""Surface files by other programs' writers, made of the smaller STL files of a folder.

    pip install -r scripts/peers/requirements_readers.txt
    python3 scripts/peers/make_surfaces.py FOLDER OUT [--each 10] [--largest 300000]

`--each` files by every writer: PLY by trimesh, meshio, Open3D and pymeshlab, ASCII and binary; 3MF by
trimesh, lib3mf and OpenSCAD; AMF by OpenSCAD, eight times as many, because it is the only one. A
file's name ends in its writer's.
"""

import argparse
import json
import subprocess
from pathlib import Path

import lib3mf
import meshio
import numpy
import open3d
import pymeshlab
import trimesh


def by_trimesh(stl, out, **how):
    trimesh.load(stl, force="mesh").export(out, **how)


def by_meshio(stl, out, binary):
    mesh = trimesh.load(stl, force="mesh")
    cells = [("triangle", numpy.asarray(mesh.faces))]
    meshio.write(out, meshio.Mesh(numpy.asarray(mesh.vertices), cells), binary=binary)


def by_open3d(stl, out, ascii):
    open3d.io.write_triangle_mesh(out, open3d.io.read_triangle_mesh(stl), write_ascii=ascii)


def by_pymeshlab(stl, out, binary):
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(stl)
    meshes.save_current_mesh(out, binary=binary)


def by_lib3mf(stl, out):
    mesh = trimesh.load(stl, force="mesh")
    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    body = model.AddMeshObject()
    for point in mesh.vertices:
        position = lib3mf.Position()
        position.Coordinates[:] = point.tolist()
        body.AddVertex(position)
    for face in mesh.faces:
        if len(set(face)) == 3:
            triangle = lib3mf.Triangle()
            triangle.Indices[:] = face.tolist()
            body.AddTriangle(triangle)
    model.AddBuildItem(body, wrapper.GetIdentityTransform())
    model.QueryWriter("3mf").WriteToFile(out)


def by_openscad(stl, out):
    command = ["openscad", "-q", "-o", out, "-D", f"path={json.dumps(stl)}", "/dev/stdin"]
    subprocess.run(command, input="import(path);", text=True, check=True, capture_output=True, timeout=60)


WRITERS = [
    ("trimesh.ply", by_trimesh, {"encoding": "binary"}, 1),
    ("trimesh_ascii.ply", by_trimesh, {"encoding": "ascii"}, 1),
    ("meshio.ply", by_meshio, {"binary": True}, 1),
    ("meshio_ascii.ply", by_meshio, {"binary": False}, 1),
    ("open3d.ply", by_open3d, {"ascii": False}, 1),
    ("open3d_ascii.ply", by_open3d, {"ascii": True}, 1),
    ("pymeshlab.ply", by_pymeshlab, {"binary": True}, 1),
    ("pymeshlab_ascii.ply", by_pymeshlab, {"binary": False}, 1),
    ("trimesh.3mf", by_trimesh, {}, 1),
    ("lib3mf.3mf", by_lib3mf, {}, 1),
    ("openscad.3mf", by_openscad, {}, 1),
    ("openscad.amf", by_openscad, {}, 8),
]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--each", type=int, default=10)
    parser.add_argument("--largest", type=int, default=300_000, help="bytes of an STL file")
    arguments = parser.parse_args()
    found = sorted(p for p in arguments.folder.rglob("*") if p.suffix.lower() == ".stl")
    found = [p for p in found if 684 < p.stat().st_size <= arguments.largest]
    arguments.out.mkdir(parents=True, exist_ok=True)
    for ending, write, how, times in WRITERS:
        made = 0
        # Each writer gets others of them.
        start = hash_of(ending) % max(len(found), 1)
        for stl in found[start:] + found[:start]:
            if made == times * arguments.each:
                break
            out = arguments.out / f"{stl.stem}.{ending}"
            try:
                write(str(stl), str(out), **how)
                made += out.exists()
            except Exception as error:
                print(f"{out.name}: {str(error)[:100]}")
        print(f"{made} {ending}", flush=True)


def hash_of(text):
    """The same in every run."""
    return sum(k * byte for k, byte in enumerate(text.encode(), 1)) * 7919


if __name__ == "__main__":
    main()
