"""Writes the STEP files that the tests read, with OpenCASCADE: `parts.py FOLDER`."""

import math
import sys

from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import BRepBuilderAPI_GTransform, BRepBuilderAPI_NurbsConvert
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.Interface import Interface_Static
from OCP.Quantity import Quantity_Color, Quantity_TOC_RGB
from OCP.STEPCAFControl import STEPCAFControl_Writer
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDocStd import TDocStd_Document
from OCP.TopLoc import TopLoc_Location
from OCP.XCAFDoc import XCAFDoc_ColorSurf, XCAFDoc_DocumentTool
from OCP.gp import gp_Ax1, gp_Ax2, gp_Dir, gp_GTrsf, gp_Pnt, gp_Trsf, gp_Vec

FOLDER = sys.argv[1]


def static(owner, name):
    return getattr(owner, name + "_s", None) or getattr(owner, name)


def write(shape, name, unit="MM"):
    writer = STEPControl_Writer()
    static(Interface_Static, "SetCVal")("write.step.unit", unit)
    writer.Transfer(shape, STEPControl_AsIs)
    writer.Write(f"{FOLDER}/{name}.step")


def moved(x, y, z, turn_deg=0.0):
    turn, shift = gp_Trsf(), gp_Trsf()
    turn.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), math.radians(turn_deg))
    shift.SetTranslation(gp_Vec(x, y, z))
    return TopLoc_Location(shift.Multiplied(turn))


def nut():
    """A round nut of 13 mm, its bore of 6.7 mm countersunk from both ends."""
    body = BRepPrimAPI_MakeCylinder(6.5, 5.3).Shape()
    body = BRepAlgoAPI_Cut(body, BRepPrimAPI_MakeCylinder(3.35, 5.3).Shape()).Shape()
    low = BRepPrimAPI_MakeCone(4.1, 3.35, 0.75).Shape()
    axis = gp_Ax2(gp_Pnt(0, 0, 5.3), gp_Dir(0, 0, -1))
    high = BRepPrimAPI_MakeCone(axis, 4.1, 3.35, 0.75).Shape()
    return BRepAlgoAPI_Cut(BRepAlgoAPI_Cut(body, low).Shape(), high).Shape()


def dome():
    """The sphere of 7 mm as rational B-splines, on a block, with a ring of a torus about it."""
    sphere = BRepBuilderAPI_NurbsConvert(BRepPrimAPI_MakeSphere(gp_Pnt(0, 0, 2), 7.0).Shape()).Shape()
    block = BRepPrimAPI_MakeBox(gp_Pnt(-12, -12, -8), gp_Pnt(12, 12, 0)).Shape()
    ring = BRepPrimAPI_MakeTorus(gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), 9.7, 1.3).Shape()
    return BRepAlgoAPI_Fuse(BRepAlgoAPI_Fuse(block, sphere).Shape(), ring).Shape()


def ball():
    return BRepPrimAPI_MakeSphere(gp_Pnt(0, 0, 0), 40.0).Shape()


def bore(radius, x, y, lean):
    """A cylinder about a line through (x, y, 0) that leans towards x, radians."""
    way = gp_Dir(math.sin(lean), 0, math.cos(lean))
    low = gp_Pnt(x - 100 * math.sin(lean), y, -100 * math.cos(lean))
    return BRepPrimAPI_MakeCylinder(gp_Ax2(low, way), radius, 200.0).Shape()


def drilled():
    """A ball with a hole beside its middle, whose edges cross the seam of the ball."""
    return BRepAlgoAPI_Cut(ball(), bore(5.0, 20, 2, 0.0)).Shape()


def slanted():
    """The ball as a rational B-spline, its hole slanted: OpenCASCADE reads it wrong in each of its ways."""
    splines = BRepBuilderAPI_NurbsConvert(ball(), True).Shape()
    shift = bore(10.0, 100 * math.sin(0.3), 0, 0.3)
    return BRepAlgoAPI_Cut(splines, shift).Shape()


def egg():
    """The ball stretched to the semi-axes 60, 32 and 24."""
    stretch = gp_GTrsf()
    for k, factor in enumerate((1.5, 0.8, 0.6), 1):
        stretch.SetValue(k, k, factor)
    return BRepBuilderAPI_GTransform(ball(), stretch, True).Shape()


def named(label, text):
    static(TDataStd_Name, "Set")(label, TCollection_ExtendedString(text))


def assembly():
    """A red plate and, twice, a pin, one of them turned."""
    document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
    shapes = static(XCAFDoc_DocumentTool, "ShapeTool")(document.Main())
    colors = static(XCAFDoc_DocumentTool, "ColorTool")(document.Main())
    plate = shapes.AddShape(BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), gp_Pnt(40, 30, 3)).Shape(), False)
    pin = shapes.AddShape(BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), gp_Pnt(8, 2, 11)).Shape(), False)
    whole = shapes.NewShape()
    for label, text in ((plate, "plate"), (pin, "pin"), (whole, "fixture")):
        named(label, text)
    colors.SetColor(plate, Quantity_Color(1.0, 0.0, 0.0, Quantity_TOC_RGB), XCAFDoc_ColorSurf)
    shapes.AddComponent(whole, plate, moved(0, 0, 0))
    shapes.AddComponent(whole, pin, moved(5, 6, 3))
    shapes.AddComponent(whole, pin, moved(30, 10, 3, 90.0))
    shapes.UpdateAssemblies()
    writer = STEPCAFControl_Writer()
    writer.SetNameMode(True)
    writer.SetColorMode(True)
    writer.Transfer(document, STEPControl_AsIs)
    writer.Write(f"{FOLDER}/assembly.step")


box = BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), gp_Pnt(0.7, 1.3, 2.9)).Shape()
write(box, "inch", "INCH")
write(box, "box")
write(nut(), "nut")
write(dome(), "dome")
write(drilled(), "drilled")
write(slanted(), "slanted")
write(egg(), "egg")
write(BRepPrimAPI_MakeCone(30.0, 0.0, 60.0).Shape(), "cone")
assembly()
