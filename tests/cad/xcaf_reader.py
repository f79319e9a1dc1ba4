"""Read STEP by OpenCASCADE's XCAF reader, as FreeCAD does: tree, names, colours, shapes."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Leaf:
    """One solid as read: names of part and instance, families above it, colour, layers, shape."""

    part: str
    instance: str
    path: tuple
    colour: tuple
    layers: tuple
    shape: object


def read_leaves(path):
    """Return the name of the root and the leaves of the assembly, in file order."""
    from OCP.IFSelect import IFSelect_ReturnStatus
    from OCP.Interface import Interface_Static
    from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor
    from OCP.STEPCAFControl import STEPCAFControl_Reader
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDF import TDF_Label, TDF_LabelSequence
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool, XCAFDoc_ShapeTool

    document = TDocStd_Document(TCollection_ExtendedString("test"))
    reader = STEPCAFControl_Reader()
    reader.SetNameMode(True)
    reader.SetColorMode(True)
    reader.SetLayerMode(True)
    setting = "read.stepcaf.subshapes.name"
    before = Interface_Static.IVal_s(setting)
    Interface_Static.SetIVal_s(setting, 1)
    try:
        assert reader.ReadFile(str(path)) == IFSelect_ReturnStatus.IFSelect_RetDone
        assert reader.Transfer(document)
    finally:
        Interface_Static.SetIVal_s(setting, before)
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    colours = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    layers = XCAFDoc_DocumentTool.LayerTool_s(document.Main())

    def name(label):
        attribute = TDataStd_Name()
        assert label.FindAttribute(TDataStd_Name.GetID_s(), attribute)
        return attribute.Get().ToExtString()

    def colour(shape):
        found = Quantity_Color()
        kinds = XCAFDoc_ColorType
        if not colours.GetColor(shape, kinds.XCAFDoc_ColorSurf, found):
            assert colours.GetColor(shape, kinds.XCAFDoc_ColorGen, found)
        rgb = found.Values(Quantity_TypeOfColor.Quantity_TOC_sRGB)
        return tuple(round(float(c), 3) for c in rgb)

    def layers_of(label):
        names = TDF_LabelSequence()
        layers.GetLayerLabels(names)
        own = []
        for k in range(1, names.Length() + 1):
            members = TDF_LabelSequence()
            layers.GetShapesOfLayer_s(names.Value(k), members)
            if any(members.Value(i).IsEqual(label) for i in range(1, members.Length() + 1)):
                text = TCollection_ExtendedString()
                layers.GetLayer(names.Value(k), text)
                own.append(text.ToExtString())
        return tuple(own)

    def walk(label, path, out):
        target = TDF_Label()
        if not XCAFDoc_ShapeTool.GetReferredShape_s(label, target):
            target = label
        children = TDF_LabelSequence()
        XCAFDoc_ShapeTool.GetComponents_s(target, children, False)
        for k in range(1, children.Length() + 1):
            walk(children.Value(k), (*path, name(target)), out)
        if not children.Length():
            shape = XCAFDoc_ShapeTool.GetShape_s(target)
            seen = (name(target), name(label), path, colour(shape), layers_of(target))
            out.append(Leaf(*seen, shape))

    free = TDF_LabelSequence()
    shapes.GetFreeShapes(free)
    assert free.Length() == 1
    leaves = []
    walk(free.Value(1), (), leaves)
    return name(free.Value(1)), leaves
