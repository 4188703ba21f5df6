"""Meshes the bodies of a STEP file with OpenCASCADE and measures the mesh against them.

Run by fluxform as `python3 -I -c TEXT CHORD CPU_SECONDS MEMORY_BYTES BODY`; needs `pip install
cadquery-ocp`. The file comes in on standard input. On standard output go lines of JSON, an object of
one key each: `version`, then any number of `stage`, last `result`, `refused` or `missing`. The line of
a result is followed by the numbers of its parts: for each its vertices (three doubles each) and its
triangles (three unsigned 32 bit indices each), in the machine's byte order. Lengths are in millimetres.

CHORD is a length, or 0 for a 4000th of the diagonal of the box of the bodies; BODY is the number (from
1) or the name of the body to be read, or empty for all.
"""

import array
import ctypes
import io
import json
import math
import os
import re
import signal
import sys
import time

# The kernel prints on standard output as it pleases: that goes nowhere.
out = os.fdopen(os.dup(1), "wb")
os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def send(**line):
    """One line of the report."""
    out.write(json.dumps(line).encode() + b"\n")
    out.flush()


def refuse(why):
    send(refused=why)
    sys.exit(0)


def bound(memory_bytes):
    """Limits of this process; it also ends with the one that started it."""
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (memory_bytes, memory_bytes))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)
    except (ImportError, AttributeError, OSError, ValueError):
        pass


def bound_time(cpu_seconds):
    """Limits the processor time from here on."""
    try:
        import resource

        ends = math.ceil(time.process_time()) + cpu_seconds
        resource.setrlimit(resource.RLIMIT_CPU, (ends, ends + 5))
    except (ImportError, OSError, ValueError):
        pass


bound(int(sys.argv[3]))

try:
    import OCP
    from OCP.Bnd import Bnd_Box
    from OCP.BRep import BRep_Tool
    from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Curve2d, BRepAdaptor_Surface
    from OCP.BRepBndLib import BRepBndLib
    from OCP.BRepCheck import BRepCheck_Analyzer, BRepCheck_NoError, BRepCheck_Wire
    from OCP.BRepGProp import BRepGProp
    from OCP.BRepTools import BRepTools
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.GProp import GProp_GProps
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.IMeshTools import IMeshTools_Parameters
    from OCP.Interface import Interface_Static
    from OCP.ShapeUpgrade import ShapeUpgrade_ShapeDivideClosed
    from OCP.GeomAbs import GeomAbs_Plane
    from OCP.Quantity import Quantity_Color
    from OCP.STEPCAFControl import STEPCAFControl_Reader
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDF import TDF_ChildIterator, TDF_Label
    from OCP.TDocStd import TDocStd_Document
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED, TopAbs_SHELL, TopAbs_SOLID, TopAbs_WIRE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS
    from OCP.XCAFDoc import XCAFDoc_ColorGen, XCAFDoc_ColorSurf, XCAFDoc_ColorTool, XCAFDoc_DocumentTool, XCAFDoc_ShapeTool
    from OCP.gp import gp_Pnt, gp_Vec

    try:
        from OCP.collections import Sequence_TCollection_AsciiString as Texts
    except ImportError:
        from OCP.TColStd import TColStd_SequenceOfAsciiString as Texts
except ImportError as error:
    send(missing=str(error))
    sys.exit(0)

# What loading takes is no fault of the file.
bound_time(int(sys.argv[2]))
send(version=getattr(OCP, "__version__", "unknown"))


def static(owner, name):
    """A static method under its name of this or of another version of OCP."""
    return getattr(owner, name + "_s", None) or getattr(owner, name)


triangulation = static(BRep_Tool, "Triangulation")
as_face = static(TopoDS, "Face")
as_edge = static(TopoDS, "Edge")
as_wire = static(TopoDS, "Wire")
surface_properties = static(BRepGProp, "SurfaceProperties")
volume_properties = static(BRepGProp, "VolumeProperties")

# Millimetres of the units of length that files are in, by OpenCASCADE's names.
UNITS_MM = {
    "millimetre": 1.0, "milimetre": 1.0, "metre": 1000.0, "centimetre": 10.0, "micrometre": 1e-3,
    "inch": 25.4, "inches": 25.4, "foot": 304.8, "feet": 304.8, "mil": 0.0254,
}
# Default chord against the diagonal of the box.
CHORD = 2.5e-4
# Facets of a curved surface turn at most so far, radians.
TURN = 0.5
# The largest of a facet's samples, times this, bounds a quadratic surface over any triangle.
BEYOND_SAMPLES = 1.25
# How a body is meshed until a mesh of it is right: the chord over the deflection to begin with, and
# whether faces that close on themselves are cut first.
ATTEMPTS = [(1.0, False), (4.0, False), (1.0, True), (4.0, True), (0.25, False)]
# Relative error of exact areas and volumes; without one OpenCASCADE errs by percents on threads, with 1e-3
# by 8e-3 on an ellipsoid: what it bounds is not the error.
INTEGRATED = 1e-6
# How curves on surfaces are read, by OpenCASCADE's `read.surfacecurve.mode`: those of the file first, then
# made again from the curves in space. Of the first it may lose the seam of a closed face.
CURVES = (0, 3)
# Most halvings of a side, and most facets of a face that are split further.
ROUNDS = 12
MOST_FACETS = 400_000


# ------------------------------------------------------------------ reading


def read(data, curves):
    """The document with the file's products, and the millimetres of the file's unit of length."""
    send(stage={"name": "STEP", "done": 0, "total": 1})
    reader = STEPCAFControl_Reader()
    static(Interface_Static, "SetIVal")("read.surfacecurve.mode", curves)
    reader.SetNameMode(True)
    reader.SetColorMode(True)
    for mode in ("SetGDTMode", "SetMatMode", "SetViewMode", "SetPropsMode", "SetLayerMode"):
        if hasattr(reader, mode):
            getattr(reader, mode)(False)
    if reader.ReadStream("part.step", io.BytesIO(data)) != IFSelect_RetDone:
        refuse("OpenCASCADE cannot parse it")
    lengths, angles, solid_angles = Texts(), Texts(), Texts()
    reader.ChangeReader().FileUnits(lengths, angles, solid_angles)
    names = {lengths.Value(k).ToCString().lower() for k in range(1, lengths.Length() + 1)}
    units = {UNITS_MM.get(name) for name in names}
    # OpenCASCADE makes millimetres of any; its own unit is stated where the file has one alone.
    unit_mm = units.pop() if len(units) == 1 else None
    document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
    if not reader.Transfer(document):
        refuse("it holds no shape")
    return document, unit_mm or 1.0


STATEMENT = re.compile(
    rb"#(\d+)\s*=\s*(AXIS2_PLACEMENT_?3D|CARTESIAN_POINT|DIRECTION|\w*SHAPE_REPRESENTATION)\s*\(([^;]*)\)\s*;"
)


def moved_roots(data):
    """How many placements of the file's own, outside assemblies, are not its frame itself."""
    if b"NEXT_ASSEMBLY_USAGE_OCCURRENCE" in data or b"MAPPED_ITEM" in data:
        return 0
    kinds = {}
    for number, kind, body in STATEMENT.findall(data):
        kinds.setdefault(kind.replace(b"_3D", b"3D"), {})[number] = body

    def vector(kind, number, default):
        body = kinds.get(kind, {}).get(number, b"").rpartition(b"(")[2].rstrip(b") \n\r")
        try:
            return [float(text) for text in body.split(b",")]
        except ValueError:
            return default

    count = 0
    frames = kinds.get(b"AXIS2_PLACEMENT3D", {})
    for kind, items in kinds.items():
        if not kind.endswith(b"SHAPE_REPRESENTATION"):
            continue
        for body in items.values():
            listed = re.findall(rb"#(\d+)", body.partition(b"(")[2].partition(b")")[0])
            for frame in (frames[number] for number in listed if number in frames):
                parts = re.findall(rb"#(\d+)|\$", frame) + [b"", b""]
                own = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]
                kinds_of = (b"CARTESIAN_POINT", b"DIRECTION", b"DIRECTION")
                found = [vector(k, n, d) for k, n, d in zip(kinds_of, parts, own)]
                off = (abs(a - b) for x, y in zip(found, own) for a, b in zip(x, y))
                count += max(off) > 1e-9
    return count


def children(label):
    """The labels right below."""
    found = TDF_ChildIterator(label, False)
    while found.More():
        yield found.Value()
        found.Next()


def name_of(label):
    """The label's name, empty where it has none."""
    kind, name = static(TDataStd_Name, "GetID")(), TDataStd_Name()
    # Asked first: OCP 8 crashes where the attribute is missing.
    if not label.IsAttribute(kind) or not label.FindAttribute(kind, name):
        return ""
    return str(name.Get().ToExtString()).strip()


def explored(shape, kind, outside=None):
    """The parts of a kind within a shape, each as often as it occurs."""
    found = TopExp_Explorer(shape, kind) if outside is None else TopExp_Explorer(shape, kind, outside)
    while found.More():
        yield found.Current()
        found.Next()


class Products:
    """The placed bodies of a document, each part read once."""

    def __init__(self, document):
        self.shapes = static(XCAFDoc_DocumentTool, "ShapeTool")(document.Main())
        self.colors = static(XCAFDoc_DocumentTool, "ColorTool")(document.Main())
        self.parts = {}
        self.bodies = []
        # Faces and shells that bound no body.
        self.loose = 0
        for label in children(self.shapes.BaseLabel()):
            if static(XCAFDoc_ShapeTool, "IsFree")(label):
                self.add(label, TopLoc_Location(), [], None)

    def color(self, thing):
        """Red, green, blue of a label or shape; None where it has none."""
        color = Quantity_Color()
        of_label = isinstance(thing, TDF_Label)
        get = XCAFDoc_ColorTool.GetColor_s if of_label else self.colors.GetColor
        for kind in (XCAFDoc_ColorSurf, XCAFDoc_ColorGen):
            if get(thing, kind, color):
                return [color.Red(), color.Green(), color.Blue()]
        return None

    def add(self, label, place, names, color):
        """The bodies below a label, at a place; a colour above is that of what has none."""
        tool = XCAFDoc_ShapeTool
        target, name = label, name_of(label)
        if static(tool, "IsReference")(label):
            target = TDF_Label()
            static(tool, "GetReferredShape")(label, target)
            place = place.Multiplied(static(tool, "GetLocation")(label))
            name = name_of(target) or name
        color = self.color(label) or self.color(target) or color
        if static(tool, "IsAssembly")(target):
            for child in children(target):
                if static(tool, "IsComponent")(child):
                    self.add(child, place, names + [name], color)
            return
        for number, (shape, inner, own, tint) in enumerate(self.part(target)):
            self.bodies.append({
                "shape": shape,
                "place": place.Multiplied(inner),
                "name": own or name,
                "within": names,
                "color": tint or color,
                "part": (self.key(target), number),
            })

    @staticmethod
    def key(label):
        """The label's path from the root."""
        path = []
        while not label.IsRoot():
            path.append(label.Tag())
            label = label.Father()
        return tuple(path)

    def part(self, label):
        """The bodies of one part: shape, its place in the part, name, colour."""
        key = self.key(label)
        if key not in self.parts:
            tool = XCAFDoc_ShapeTool
            whole = static(tool, "GetShape")(label)
            solids = list(explored(whole, TopAbs_SOLID))
            loose = list(explored(whole, TopAbs_SHELL, TopAbs_SOLID))
            loose += list(explored(whole, TopAbs_FACE, TopAbs_SHELL))
            self.loose += len(loose)
            below = [child for child in children(label) if static(tool, "IsSubShape")(child)]
            named = [(static(tool, "GetShape")(child), name_of(child)) for child in below]
            found = []
            for solid in solids:
                name = next((n for shape, n in named if len(solids) > 1 and shape.IsSame(solid)), "")
                place = solid.Location()
                found.append((solid.Located(TopLoc_Location()), place, name, self.color(solid)))
            self.parts[key] = found
        return self.parts[key]


def faults(products):
    """The parts' bodies that are invalid by OpenCASCADE's own check: the first face of each whose border
    runs the wrong way around, so that it is what the face leaves out, or None."""
    found = {}
    for body in products.bodies:
        if body["part"] in found:
            continue
        check = BRepCheck_Analyzer(body["shape"])
        if check.IsValid():
            continue
        found[body["part"]] = None
        for number, face in enumerate(explored(body["shape"], TopAbs_FACE), 1):
            # A valid face needs no second look.
            if not check.IsValid(face) and turned(as_face(face)):
                found[body["part"]] = number
                break
    return found


def turned(face):
    """Whether a border of the face is open or runs the wrong way around."""
    for wire in explored(face, TopAbs_WIRE):
        check = BRepCheck_Wire(as_wire(wire))
        states = (check.Closed(), check.Closed2d(face), check.Orientation(face))
        if any(state != BRepCheck_NoError for state in states):
            return True
    return False


def soundest(data):
    """The file's products, read in the way that leaves fewest faults; these, the parts of which another
    way had faults, and the unit, mm."""
    best, faulty = None, set()
    for curves in CURVES:
        document, unit_mm = read(data, curves)
        products = Products(document)
        found = faults(products)
        rank = (sum(face is not None for face in found.values()), len(found))
        if best is None or rank < best[0]:
            # The shapes live as long as their document.
            best = rank, products, found, unit_mm, document
        if not found:
            break
        faulty.update(label for label, _ in found)
    return best[1:4] + (faulty, best[4])


# ------------------------------------------------------------------ meshing and measuring


class Wrong(Exception):
    """Why the mesh of a body is not the body's."""


def less(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def norm(a):
    return math.sqrt(dot(a, a))


def sides(ijk):
    """The ends of a facet's sides, the smaller index first."""
    i, j, k = ijk
    return [(min(i, j), max(i, j)), (min(j, k), max(j, k)), (min(k, i), max(k, i))]


def middle(*points):
    count = len(points)
    return tuple(sum(values) / count for values in zip(*points))


def numbers(point):
    return (point.X(), point.Y(), point.Z())


def diagonal(box):
    """The diagonal of a box."""
    return 0.0 if box.IsVoid() else norm(less(numbers(box.CornerMax()), numbers(box.CornerMin())))


def from_segment(point, a, b):
    """The distance of a point from the segment from a to b."""
    along, to = less(b, a), less(point, a)
    square = dot(along, along)
    share = min(1.0, max(0.0, dot(to, along) / square)) if square > 0.0 else 0.0
    return norm(less(to, [share * c for c in along]))


class Face:
    """One face's mesh and how far it lies from the face."""

    def __init__(self, face, chord, number):
        self.face, self.chord, self.number = face, chord, number
        place = TopLoc_Location()
        self.mesh = triangulation(face, place)
        self.points, self.triangles = [], []
        # Nodes at which a parameter is any of its values: the tip of a cone, the pole of a sphere.
        self.any = {}
        self.deviation = self.area = 0.0
        exact = GProp_GProps()
        surface_properties(face, exact, INTEGRATED)
        self.exact_area = abs(exact.Mass())
        edges = GProp_GProps()
        static(BRepGProp, "LinearProperties")(face, edges)
        self.perimeter = edges.Mass()
        # Narrower than the chord: its two sides are one as far as the mesh can tell.
        self.sliver = self.exact_area <= chord * self.perimeter
        if self.mesh is None or self.mesh.NbTriangles() == 0:
            if not self.sliver:
                raise Wrong(f"face {number} of {self.exact_area:.3g} square units could not be meshed")
            return
        move = place.Transformation()
        for k in range(1, self.mesh.NbNodes() + 1):
            self.points.append(numbers(self.mesh.Node(k).Transformed(move)))
        for k in range(1, self.mesh.NbTriangles() + 1):
            a, b, c = self.mesh.Triangle(k).Get()
            self.triangles.append((a - 1, b - 1, c - 1))
        self.find_tips(place)
        self.refine()
        self.measure_edges(place)
        self.check_area()

    def find_tips(self, place):
        """Nodes on edges without length, and which parameter runs along these."""
        for edge in explored(self.face, TopAbs_EDGE):
            edge = as_edge(edge)
            if not static(BRep_Tool, "Degenerated")(edge):
                continue
            border = static(BRep_Tool, "PolygonOnTriangulation")(edge, self.mesh, place)
            if border is None:
                continue
            curve = BRepAdaptor_Curve2d(edge, self.face)
            a, b = curve.Value(curve.FirstParameter()), curve.Value(curve.LastParameter())
            runs = 0 if abs(b.X() - a.X()) > abs(b.Y() - a.Y()) else 1
            self.any.update((border.Node(k) - 1, runs) for k in range(1, border.NbNodes() + 1))

    def between(self, uv, nodes):
        """The mean parameters of nodes; a parameter that is arbitrary at a node is that of the others."""
        mean = []
        for k in (0, 1):
            known = [uv[node][k] for node in nodes if self.any.get(node) != k]
            known = known or [uv[node][k] for node in nodes]
            mean.append(sum(known) / len(known))
        return mean

    def refine(self):
        """Splits facets until the surface lies within the chord of them; no facet looks backwards.

        OpenCASCADE's own mesh may miss the chord inside a face many times over. Sides between two
        facets are split, those on the border stay: the next face has them too.
        """
        surface = BRepAdaptor_Surface(self.face, False)
        plane = surface.GetType() == GeomAbs_Plane
        uv = [self.mesh.UVNode(k) for k in range(1, self.mesh.NbNodes() + 1)]
        uv = [(p.X(), p.Y()) for p in uv]
        for p, (u, v) in zip(self.points, uv):
            self.deviation = max(self.deviation, norm(less(p, numbers(surface.Value(u, v)))))
        if plane:
            for ijk in self.triangles:
                self.facet(ijk, surface, uv, None)
            return
        most = self.chord / BEYOND_SAMPLES
        middles, unseen, settled = {}, self.triangles, {}
        kept = None
        for last in [False] * ROUNDS + [True]:
            count = {}
            for ijk in self.triangles:
                for side in sides(ijk):
                    count[side] = count.get(side, 0) + 1
            marked = set()
            try:
                for ijk in unseen:
                    inner, along = self.facet(ijk, surface, uv, middles)
                    settled[ijk] = max(inner, *along.values())
                    if settled[ijk] <= most:
                        continue
                    free = [side for side in along if count[side] == 2]
                    far = [side for side in free if along[side] > most]
                    marked.update(far or sorted(free, key=lambda ij: -self.length(ij))[:1])
            except Wrong:
                # Near a pole halves may fold: the mesh before them stays.
                if kept is None:
                    raise
                self.triangles, points = kept
                del self.points[points:]
                break
            if last or not marked or len(self.triangles) > MOST_FACETS:
                break
            kept = self.triangles, len(self.points)
            self.triangles, unseen = self.split(marked, middles, uv)
        sampled = max((settled[ijk] for ijk in self.triangles), default=0.0)
        self.deviation = max(self.deviation, BEYOND_SAMPLES * sampled)

    def length(self, side):
        i, j = side
        return norm(less(self.points[i], self.points[j]))

    def facet(self, ijk, surface, uv, middles):
        """How far the surface leaves a facet at its middle and at the middles of its sides."""
        a, b, c = (self.points[k] for k in ijk)
        normal = cross(less(b, a), less(c, a))
        twice = norm(normal)
        along = dict.fromkeys(sides(ijk), 0.0)
        if twice == 0.0:
            return 0.0, along
        longest = max(self.length(side) for side in along)
        u, v = self.between(uv, ijk)
        at, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
        surface.D1(u, v, at, du, dv)
        outward = cross(numbers(du), numbers(dv))
        if dot(outward, normal) < 0.0 and twice / longest > self.chord:
            raise Wrong(f"the mesh of face {self.number} is folded")
        if middles is None:
            return 0.0, along

        def off(exact, flat):
            apart = less(exact, flat)
            # The parameters run unevenly, but not out of the facet.
            far = norm(apart)
            return far if far > longest + self.chord else abs(dot(apart, normal)) / twice

        for i, j in along:
            if (i, j) not in middles:
                middles[i, j] = numbers(surface.Value(*self.between(uv, (i, j))))
            along[i, j] = off(middles[i, j], middle(self.points[i], self.points[j]))
        return off(numbers(at), middle(a, b, c)), along

    def split(self, marked, middles, uv):
        """All facets with the marked sides halved, and those of them that are new."""
        halves = {}
        for i, j in sorted(marked):
            halves[i, j] = len(self.points)
            self.points.append(middles[i, j])
            uv.append(tuple(self.between(uv, (i, j))))
        whole, new = [], []
        for ijk in self.triangles:
            cut = [halves.get(side) for side in sides(ijk)]
            if cut == [None] * 3:
                whole.append(ijk)
                continue
            # Turned so that the uncut sides come last.
            while cut[0] is None or (cut[1] is None and cut[2] is not None):
                ijk, cut = ijk[1:] + ijk[:1], cut[1:] + cut[:1]
            (a, b, c), (d, e, f) = ijk, cut
            if e is None:
                new += [(a, d, c), (d, b, c)]
            elif f is None:
                new += [(d, b, e), (a, d, e), (a, e, c)]
            else:
                new += [(a, d, f), (d, b, e), (f, e, c), (d, e, f)]
        return whole + new, new

    def measure_edges(self, place):
        """The mesh's border against the edges that trim the face."""
        for edge in explored(self.face, TopAbs_EDGE):
            edge = as_edge(edge)
            if static(BRep_Tool, "Degenerated")(edge):
                continue
            border = static(BRep_Tool, "PolygonOnTriangulation")(edge, self.mesh, place)
            if border is None:
                raise Wrong(f"an edge of face {self.number} is not in its mesh")
            curve = BRepAdaptor_Curve(edge)
            if not border.HasParameters():
                continue
            count = border.NbNodes()
            where = [border.Parameter(k) for k in range(1, count + 1)]
            nodes = [self.points[border.Node(k) - 1] for k in range(1, count + 1)]
            for k in range(count):
                at = numbers(curve.Value(where[k]))
                self.deviation = max(self.deviation, norm(less(at, nodes[k])))
                if k > 0:
                    at = numbers(curve.Value(0.5 * (where[k - 1] + where[k])))
                    off = from_segment(at, nodes[k - 1], nodes[k])
                    self.deviation = max(self.deviation, off)

    def check_area(self):
        """Facets cover the face, and nothing else."""
        for ijk in self.triangles:
            a, b, c = (self.points[k] for k in ijk)
            self.area += 0.5 * norm(cross(less(b, a), less(c, a)))
        bow = max(self.chord, self.deviation) * self.perimeter
        if abs(self.area - self.exact_area) > 2.0 * bow + 0.03 * self.exact_area:
            raise Wrong(
                f"the mesh of face {self.number} covers {self.area:.6g} square units of "
                f"{self.exact_area:.6g}"
            )

    def outward(self):
        """The triangles, counterclockwise from outside."""
        if self.face.Orientation() == TopAbs_REVERSED:
            return [(a, c, b) for a, b, c in self.triangles]
        return self.triangles


def mesh_of(shape, chord, deflection):
    """The mesh of one body, begun at a deflection, and the figures that it is judged by."""
    how = IMeshTools_Parameters()
    how.Deflection = deflection
    how.Angle = TURN
    how.InternalVerticesMode = True
    how.ControlSurfaceDeflection = True
    BRepMesh_IncrementalMesh(shape, how)
    points, triangles = array.array("d"), array.array("I")
    area = deviation = 0.0
    faces = 0
    for face in explored(shape, TopAbs_FACE):
        faces += 1
        measured = Face(as_face(face), chord, faces)
        deviation = max(deviation, measured.deviation)
        area += measured.exact_area
        first = len(points) // 3
        for point in measured.points:
            points.extend(point)
        for triangle in measured.outward():
            triangles.extend(first + k for k in triangle)
    exact = GProp_GProps()
    volume_properties(shape, exact, INTEGRATED)
    return {
        "points": points,
        "triangles": triangles,
        "deviation": deviation,
        "area": area,
        "volume": abs(exact.Mass()),
    }


def meshed(shape, chord):
    """As mesh_of, from a finer mesh where the first is wrong or misses the chord."""
    best, wrong = None, None
    for finer, cut in ATTEMPTS:
        tried = shape
        if cut:
            divided = ShapeUpgrade_ShapeDivideClosed(shape)
            if not divided.Perform():
                continue
            tried = divided.Result()
        static(BRepTools, "Clean")(tried)
        try:
            body = mesh_of(tried, chord, chord / finer)
        except Wrong as error:
            wrong = error
            continue
        if best is None or body["deviation"] < best["deviation"]:
            best = body
        if best["deviation"] <= chord:
            break
    if best is None:
        raise wrong
    return best


def chosen(bodies, which):
    """The body of a number, or the bodies of a name or within an assembly of that name."""
    if which == "":
        return bodies
    named = [body for body in bodies if which in (body["name"], *body["within"])]
    if not named and which.isdecimal() and 1 <= int(which) <= len(bodies):
        named = [bodies[int(which) - 1]]
    if not named:
        listed = ", ".join(f"{k} {body['name']}" for k, body in enumerate(bodies[:20], 1))
        more = ", ..." if len(bodies) > 20 else ""
        refuse(f"it has no body `{which}`; its {len(bodies)} bodies are {listed}{more}")
    return named


def main():
    chord = float(sys.argv[1])
    data = sys.stdin.buffer.read()
    products, found, unit_mm, faulty, document = soundest(data)
    bodies = chosen(products.bodies, sys.argv[4])
    if chord == 0.0:
        box = Bnd_Box()
        for body in bodies:
            # The box that is quick to have holds the poles of splines, far out.
            moved = body["shape"].Moved(body["place"])
            static(BRepBndLib, "AddOptimal")(moved, box, False, False)
        chord = CHORD * diagonal(box)
    parts, stated = {}, []
    for number, body in enumerate(bodies):
        send(stage={"name": "bodies", "done": number, "total": len(bodies)})
        key = body["part"]
        if found.get(key) is not None:
            refuse(
                f"body {number + 1} `{body['name']}`: OpenCASCADE takes the border of its face "
                f"{found[key]} the wrong way around, and so the wrong part of the face"
            )
        if key not in parts:
            try:
                parts[key] = meshed(body["shape"], chord)
                parts[key]["mended"] = key[0] in faulty and key not in found
            except Wrong as wrong:
                refuse(f"body {number + 1} `{body['name']}`: {wrong}")
        move = body["place"].Transformation()
        stated.append({
            "part": list(parts).index(key),
            "place": [[move.Value(i, j) for j in (1, 2, 3, 4)] for i in (1, 2, 3)],
            "name": body["name"],
            "within": body["within"],
            "color": body["color"],
        })
    lists = ("points", "triangles")
    figures = [{k: len(v) if k in lists else v for k, v in part.items()} for part in parts.values()]
    send(result={
        "unit_mm": unit_mm, "chord_mm": chord, "loose": products.loose,
        "moved_roots": moved_roots(data), "invalid": sum(body["part"] in found for body in bodies),
        "bodies": stated, "parts": figures,
    })
    for part in parts.values():
        for name in lists:
            out.write(part[name].tobytes())
    out.flush()


if __name__ == "__main__":
    main()
