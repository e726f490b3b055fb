"""The formats of text: what is around the numbers."""

from __future__ import annotations

from .writing import Shape, TextLayout


def txt(shape: Shape) -> TextLayout:
    sizes = (shape.dimension, shape.ambient_dimension, shape.vertices, shape.simplices)
    return TextLayout(" ".join(map(str, sizes)) + "\n", (("", ""),))


def off(shape: Shape) -> TextLayout:
    d = shape.ambient_dimension
    kind = "OFF\n" if d == 3 else f"nOFF\n{d}\n"
    prefix = f"{shape.groups[0].dimension + 1} "
    return TextLayout(f"{kind}{shape.vertices} {shape.simplices} 0\n", (("", prefix),))


def obj(shape: Shape) -> TextLayout:
    groups = tuple(
        (f"g {group.name}\n" if group.name else "", ("p ", "l ", "f ")[group.dimension])
        for group in shape.groups
    )
    return TextLayout("", groups, point_prefix="v ", in_space=True, first_id=1)


def msh(shape: Shape) -> TextLayout:
    """Gmsh's format 2.2, which every version of it reads, and most others who read .msh."""
    element_types = (15, 1, 2, 4)  # point, line, triangle, tetrahedron
    head = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
    if len(shape.groups) > 1:
        names = "".join(f'{it.dimension} {it.tag} "{it.name}"\n' for it in shape.groups)
        head += f"$PhysicalNames\n{len(shape.groups)}\n{names}$EndPhysicalNames\n"
    # Two tags for each element: its physical group and its geometrical entity, by the same number.
    groups = tuple(
        ("", f" {element_types[group.dimension]} 2 {group.tag} {group.tag} ")
        for group in shape.groups
    )
    return TextLayout(
        f"{head}$Nodes\n{shape.vertices}\n",
        groups,
        middle=f"$EndNodes\n$Elements\n{shape.simplices}\n",
        end="$EndElements\n",
        point_prefix=" ",
        in_space=True,
        numbered=True,
        first_id=1,
    )
