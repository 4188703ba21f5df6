"""One peer on one STL file, in a process of its own; prints JSON. Started by compare_surface.py.

    python surface_peer.py PEER FILE.stl HEIGHTS.npy SAMPLES HALF_MM STRIDE
    python surface_peer.py --rows PROBLEM.json                      # see rows.py

Reads the file, then sends a vertical ray from above through every STRIDE-th point of a grid of
SAMPLES x SAMPLES points from -HALF_MM to HALF_MM and keeps the first hit, as each program's
documentation has it; building the search tree counts as sampling. CPU time is that of all
threads. With SAMPLES 0 only reads, and tells what came of it. With --rows trimesh and Open3D get
the problem's triangles in memory, in millimetres as ever, and what is timed is tree and rays.
"""

import json
import resource
import sys
import time

import rows

if rows.lacks("numpy", "numpy") is None:
    import numpy as np

ABOVE_MM = 1000.0
MM = 1000.0


def trimesh_peer():
    import embreex  # noqa: F401  without it trimesh falls back to a slow search
    import trimesh
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    def read(path):
        return trimesh.load_mesh(path)

    def sample(mesh, points):
        origins = np.column_stack([points, np.full(len(points), ABOVE_MM)])
        down = np.tile([0.0, 0.0, -1.0], (len(points), 1))
        hits, rays, _ = RayMeshIntersector(mesh).intersects_location(
            origins, down, multiple_hits=False
        )
        heights = np.full(len(points), np.nan)
        heights[rays] = hits[:, 2]
        return heights

    return f"trimesh {trimesh.__version__}, embreex", read, lambda mesh: len(mesh.faces), sample


def open3d_peer():
    import open3d as o3d

    def read(path):
        return o3d.io.read_triangle_mesh(path)

    def sample(mesh, points):
        scene = o3d.t.geometry.RaycastingScene()
        scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(mesh))
        rays = np.zeros((len(points), 6), dtype=np.float32)
        rays[:, :2] = points
        rays[:, 2] = ABOVE_MM
        rays[:, 5] = -1.0
        distance = scene.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy().astype(float)
        return np.where(np.isfinite(distance), ABOVE_MM - distance, np.nan)

    return f"Open3D {o3d.__version__}", read, lambda mesh: len(mesh.triangles), sample


def vtk_peer(locator):
    import vtk

    def read(path):
        reader = vtk.vtkSTLReader()
        reader.SetFileName(path)
        reader.Update()
        return reader.GetOutput()

    def static(mesh, points):
        tree = vtk.vtkStaticCellLocator()
        tree.SetDataSet(mesh)
        tree.BuildLocator()
        heights = np.full(len(points), np.nan)
        at, hit, within = vtk.mutable(0.0), [0.0] * 3, [0.0] * 3
        side, cell = vtk.mutable(0), vtk.mutable(0)
        for k, (x, y) in enumerate(points):
            ends = (x, y, ABOVE_MM), (x, y, -ABOVE_MM)
            if tree.IntersectWithLine(*ends, 1e-6, at, hit, within, side, cell):
                heights[k] = hit[2]
        return heights

    def obb(mesh, points):
        tree = vtk.vtkOBBTree()
        tree.SetDataSet(mesh)
        tree.BuildLocator()
        heights = np.full(len(points), np.nan)
        hits = vtk.vtkPoints()
        for k, (x, y) in enumerate(points):
            tree.IntersectWithLine((x, y, ABOVE_MM), (x, y, -ABOVE_MM), hits, None)
            if hits.GetNumberOfPoints():
                heights[k] = max(hits.GetPoint(i)[2] for i in range(hits.GetNumberOfPoints()))
        return heights

    name = f"VTK {vtk.vtkVersion.GetVTKVersion()}, {locator}"
    sample = obb if locator == "vtkOBBTree" else static
    return name, read, lambda mesh: mesh.GetNumberOfCells(), sample


PEERS = {
    "trimesh": trimesh_peer,
    "open3d": open3d_peer,
    "vtk-static": lambda: vtk_peer("vtkStaticCellLocator"),
    "vtk-obb": lambda: vtk_peer("vtkOBBTree"),
}


def peak_mib():
    # The kernel's own figure: getrusage's holds the starting process' peak as well.
    try:
        with open("/proc/self/status") as status:
            return next(int(line.split()[1]) for line in status if line.startswith("VmHWM:")) / 1024
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def trimesh_of(triangles_mm):
    import trimesh

    corners = triangles_mm.reshape(-1, 3)
    faces = np.arange(len(corners)).reshape(-1, 3)
    return trimesh.Trimesh(corners, faces, process=False)


def open3d_of(triangles_mm):
    import open3d as o3d

    corners = triangles_mm.reshape(-1, 3)
    faces = np.arange(len(corners)).reshape(-1, 3)
    return o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(corners), o3d.utility.Vector3iVector(faces)
    )


def rows_of(asked):
    """A row a peer: the rays of the whole grid."""
    curves, missing = [], []
    known = (
        ("trimesh", ("trimesh", "embreex"), trimesh_peer, trimesh_of),
        ("Open3D", ("open3d",), open3d_peer, open3d_of),
    )
    for name, modules, peer, mesh_of in known:
        lacks = rows.lacks(name, "numpy", *modules)
        if lacks:
            missing.append(lacks)
            continue
        mesh = mesh_of(MM * np.array(asked["triangles_m"]))
        points = MM * np.array(np.meshgrid(asked["x_m"], asked["y_m"])).reshape(2, -1).T
        *_, sample = peer()
        heights, spread = rows.timed(lambda: sample(mesh, points))
        off = abs(heights[asked["looked_at"]] / MM - np.array(asked["height_m"]))
        reported = [rows.row(len(asked["x_m"]), len(points), np.max(off), spread)]
        version = rows.version(modules[0])
        curves.append(rows.curve(asked, name, version, "points along x and y", reported))
    rows.answer(curves, missing)


def main():
    asked = rows.problem()
    if asked:
        rows_of(asked)
        return
    peer, path, out = sys.argv[1:4]
    samples, half_mm, stride = int(sys.argv[4]), float(sys.argv[5]), int(sys.argv[6])
    name, read, count, sample = PEERS[peer]()
    imported = peak_mib()
    start = time.process_time()
    mesh = read(path)
    read_s = time.process_time() - start
    result = {"name": name, "imported_mib": imported, "read_s": read_s, "triangles": count(mesh)}
    if samples:
        nodes = np.linspace(-half_mm, half_mm, samples)
        points = np.array(np.meshgrid(nodes, nodes)).reshape(2, -1).T[::stride]
        start = time.process_time()
        heights = sample(mesh, points)
        result["sample_s"] = time.process_time() - start
        np.save(out, heights)
    result["peak_mib"] = peak_mib()
    print(json.dumps(result))


if __name__ == "__main__":
    main()
