"""The build folder that the tests of the report read: every file of it, by the writers of a build."""

import gzip
import html
import io
import json
import re
from base64 import b64decode
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import trimesh
from matplotlib.figure import Figure
from PIL import Image
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from scanwright.cad.checks.checks_json import checks_text
from scanwright.design.angles import STANDARD_DEG, Angles, AngleSet
from scanwright.design.files.picture_files import save_picture
from scanwright.design.findings import Finding
from scanwright.design.left_out import LeftOut
from scanwright.design.search.mounts.reference import reference_mounts
from scanwright.design.self_occlusion import AXIS_STEPS, SelfOcclusion, self_occlusion_bytes
from scanwright.design.task.task import load_task
from scanwright.pipeline import records as writer
from scanwright.pipeline.manifest import write_manifest
from scanwright.pipeline.records import write_report
from scanwright.report.answer import problem_as_built
from scanwright.report.density_sphere import STEP_DEG, density_sphere
from scanwright.report.scanner_scene import load_glb, scanner_scene

VOID = {"meta", "link", "img", "input", "br"}
Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
EVIL = "</script><script>alert(1)</script>"
ROLLING = Angles(
    **dict(zip(("alpha_rot", "beta_rot", "alpha_laser", "beta_laser"), STANDARD_DEG["rolling"], strict=True))
)
ANGLES = AngleSet(
    task="ground_ahead",
    angles_deg=ROLLING,
    t_world_rot_mm=(10.0, 20.0, 300.0),
    sensor="UTM-30LX",
    servo="MX-64R",
    slip_ring="SNU11-P0210",
    motion={"mode": "spin", "period_s": 18.0},
    J=-5.7636,
    J_error=5e-4,
)


class Page(HTMLParser):
    """Text by section, ids, links, and scripts of a page whose tags must match."""

    def __init__(self, text):
        super().__init__()
        self.open, self.ids, self.links, self.scripts = [], [], [], 0
        self.text = {}
        self.section = ""
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attributes):
        facts = dict(attributes)
        self.ids += [facts["id"]] if "id" in facts else []
        self.links += [facts[key] for key in ("src", "href", "srcset", "action", "data", "poster") if key in facts]
        self.scripts += tag == "script"
        self.section = facts["id"] if tag == "section" else self.section
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open[-1:] not in (["script"], ["style"]):
            self.text[self.section] = self.text.get(self.section, "") + data


def own_body(beams=1081):
    stator = np.zeros((beams, AXIS_STEPS), bool)
    stator[500:600, :180] = True
    return SelfOcclusion(np.arange(beams) < 100, stator), np.linspace(-2.3, 2.3, beams)


def glb(place):
    """A box that stands still and one that turns, as glTF has it: y up."""
    scene = trimesh.Scene()
    scene.graph.update("servo", matrix=Y_UP @ ANGLES.T_world_rot(0.0))
    scene.graph.update("rot", "servo", matrix=np.eye(4))
    scene.graph.update("laser", "rot", matrix=ANGLES.T_rot_laser())
    for name, parent in (("base_mount", "servo"), ("lidar_body", "laser")):
        T = trimesh.transformations.translation_matrix(place[name])
        box = trimesh.creation.box((0.02, 0.04, 0.06))
        box.visual = TextureVisuals(material=PBRMaterial(baseColorFactor=[0.5, 0.0, 1.0, 1.0]))
        scene.add_geometry(box, name, name, parent, T)
    return scene.export(file_type="glb")


def write_folder(folder):
    """Every file that the report reads, by the writers of a build where they need no kernel."""
    loaded = load_task(Path("ground_ahead"))
    (folder / "angles.json").write_text(ANGLES.to_json())
    writer.write_task(folder, loaded)
    writer.write_left_out(folder, [LeftOut("masked directions", EVIL, 12345, "square degrees")])
    save_picture(Figure(figsize=(1, 1)), folder / "density.png")
    (folder / "own_body.npz").write_bytes(self_occlusion_bytes(*own_body()))
    apart = {"base_mount": (0, 0, -0.1), "lidar_body": (0, 0, 0.2)}
    (folder / "assembly.glb").write_bytes(glb(dict.fromkeys(apart, (0, 0, -0.1))))
    (folder / "exploded.glb").write_bytes(glb(apart))
    places = {"ok": "rotor", "note": "fdm-0.4", "warning": "base_mount", "error": "base_mount and lidar_body"}
    checks = [Finding("wall", s, places[s], f"{s} of {EVIL}") for s in ("ok", "note", "warning", "error", "ok")]
    (folder / "checks.json").write_text(checks_text(checks))
    rows = ["bought,lidar,UTM-30LX,1,Hokuyo,,5000.0,5000.0,5000.0,5000.0,2016,370.0,,yes,"]
    rows += [f"printed,base_mount,1,1,,,,,0.0,0.0,,9.1,,,solid after {'drawings/' * 9}base_mount.pdf"]
    rows += ["nut,hexagon nut,ISO 4032 M4,4" + 11 * ","]
    rows += ['total,all rows,,,,,,5438.5,5400,5500,,,,,"sum of 4"']
    header = "kind,part,number,quantity,supplier,supplier_number,unit_usd,total_usd,low_usd,high_usd,priced,mass_g,"
    header += "source,verified,note"
    (folder / "bom.csv").write_text("\n".join([header, *rows, ""]))
    (folder / "assembly.md").write_text(
        f"# Title\n\nLook at `exploded.glb`.\n\n![Plate](density.png)\n\n## 1. Servo\n\n**4 x M4** {EVIL}\n"
    )
    (folder / "wiring.svg").write_text(
        f"<svg xmlns='http://www.w3.org/2000/svg'><text>{html.escape(EVIL)}</text></svg>"
    )
    (folder / "wiring.md").write_text(f"# Title\n\n## Power\n\n- F1 {EVIL}\n- F2\n")
    (folder / "drawings").mkdir()
    (folder / "drawings" / "base_mount.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><script>alert(1)</script></svg>'
    )
    write_manifest(folder, loaded, [])
    write_report(folder)


def drawn(folder, angles, hidden):
    """What the page draws of a folder."""
    assembly, exploded = (load_glb(folder / name) for name in ("assembly.glb", "exploded.glb"))
    return scanner_scene(assembly, exploded, angles, hidden)


def sphere(loaded):
    problem = problem_as_built(loaded, ANGLES)
    mounts = reference_mounts(problem, loaded.task)
    return density_sphere(problem, ANGLES, mounts)


def scene_of(text):
    """What the stage of a page draws."""
    return json.loads(gzip.decompress(b64decode(re.search(r'id="scene">(.*?)</script>', text)[1])))


def picture(data):
    return Image.open(io.BytesIO(b64decode(data.partition(",")[2]))).convert("RGB")


def cell(direction):
    """Column and row of a direction in a picture of the sphere, by another way than the pictures are made."""
    x, y, z = direction / np.linalg.norm(direction)
    phi, theta = np.degrees(np.arctan2(y, x)), np.degrees(np.arctan2(np.hypot(x, y), z))
    return int((phi + 180) / STEP_DEG) % int(360 / STEP_DEG), int(theta / STEP_DEG)
