"""Pictures as files: the SVG says the same as the PNG, holds what is dense as pixels, and is the same every time."""

from xml.etree import ElementTree

import numpy as np
from matplotlib.figure import Figure

from scanwright.design.files.picture_files import save_picture

SVG = "{http://www.w3.org/2000/svg}"


def figure():
    picture = Figure(figsize=(4, 3))
    axis = picture.subplots()
    axis.pcolormesh(np.random.default_rng(0).random((200, 200)), rasterized=True)
    axis.set_title("a title")
    return picture


def test_an_svg_comes_beside_the_png_with_a_dense_mesh_as_one_picture_and_the_same_bytes(tmp_path):
    for name in ("one", "two"):
        save_picture(figure(), tmp_path / f"{name}.png")
    assert (tmp_path / "one.svg").read_bytes() == (tmp_path / "two.svg").read_bytes()
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "two.png").read_bytes()
    root = ElementTree.parse(tmp_path / "one.svg").getroot()
    width, height = (float(root.get(side).removesuffix("pt")) for side in ("width", "height"))
    assert (width, height) == (4 * 72, 3 * 72)
    assert len(list(root.iter(f"{SVG}image"))) == 1 and len(list(root.iter(f"{SVG}path"))) < 200
    assert not list(root.iter(f"{SVG}text"))  # outlines: no font is asked for where it is shown
    assert b"date" not in (tmp_path / "one.svg").read_bytes()
