"""The drawing of the wiring: no words meet, and every pin and wire of the network is on it."""

import itertools
import re
from xml.etree import ElementTree

import numpy as np
import pytest

from scanwright.cad.files.wiring import schematic_svg, wiring_files
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.servo import Servo
from scanwright.design.electrics.wiring import network_of
from scanwright.design.scanner import scanner_of

SVG = "{http://www.w3.org/2000/svg}"
SCANNERS = {
    "a through bore": ("UTM-30LX", "MX-64R", "UH1256-02-0610-06S"),
    "a capsule": ("UTM-30LX", "MX-64R", "SRC022A-6"),
    "ethernet": ("UST-10LX", "XM430-W350", "SNU11-P0210"),
    "no ring": ("URG-04LX", "AX-12A", None),
    "a tied pin": ("LD19", "XL330-M288", "SRC022A-6"),
    "a tied pin and no ring": ("STL27L", "XL430-W250", None),
    "a narrow supply": ("RPLIDAR C1", "STS3215", None),
    "colours that differ": ("RPLIDAR S1", "XM430-W350", "UH1256-02-0610-06S"),
    "too weak a ring": ("RPLIDAR S2", "MX-64R", "SRC022A-6"),
    "powered by usb": ("URG-04LX-UG01", "XL330-M288", "SRC022A-6"),
}


def scanner_for(lidar, servo, ring):
    angles = AngleSet(
        task="wired",
        angles_deg=Angles(alpha_rot=0, beta_rot=0, alpha_laser=0, beta_laser=0),
        sensor=lidar,
        servo=servo,
        slip_ring=ring,
    )
    return scanner_of(angles, "fdm-0.4", load_catalogue())


def extent(text):
    """Left, top, right, bottom of a text; a letter of the font is at most 0.62 of its size wide on average."""
    size, x, y = (float(text.get(key)) for key in ("font-size", "x", "y"))
    width = 0.62 * size * len(text.text) * (0.9 if text.get("text-anchor") == "end" else 1.0)
    left = x - width if text.get("text-anchor") == "end" else x
    return left, y - 0.8 * size, left + width, y + 0.2 * size


@pytest.mark.parametrize("name", SCANNERS)
def test_no_words_of_the_drawing_meet_and_nothing_is_missing(name):
    scanner = scanner_for(*SCANNERS[name])
    network = network_of(scanner)
    picture = ElementTree.fromstring(schematic_svg(network, "wiring"))
    texts = picture.findall(f"{SVG}text")
    for one, other in itertools.combinations(texts, 2):
        a, b = extent(one), extent(other)
        assert min(a[2], b[2]) - max(a[0], b[0]) < 1 or min(a[3], b[3]) - max(a[1], b[1]) < 1, (one.text, other.text)
    words = [text.text for text in texts]
    for wire in network.wires:
        assert words.count(wire.words) >= 1
    for box in network.boxes:
        assert box.title in words and {*box.left, *box.right} <= {*words}
    lines = [
        [tuple(map(float, point.split(","))) for point in line.get("points").split()]
        for line in picture.findall(f"{SVG}polyline")
    ]
    assert len(lines) == len(network.wires)
    runs = [(a, b) for line in lines for a, b in itertools.pairwise(line) if a != b]
    for (a, b), (c, d) in itertools.combinations(runs, 2):  # no two wires lie on one another
        for i in (0, 1):
            if a[i] == b[i] == c[i] == d[i]:
                low, high = (
                    max(min(a[1 - i], b[1 - i]), min(c[1 - i], d[1 - i])),
                    min(max(a[1 - i], b[1 - i]), max(c[1 - i], d[1 - i])),
                )
                assert high <= low, (a, b, c, d)


def test_the_words_tell_power_circuits_and_wires():
    files = wiring_files(scanner_for(*SCANNERS["a through bore"]), "0" * 12)
    assert files == wiring_files(scanner_for(*SCANNERS["a through bore"]), "0" * 12)
    text = files["wiring.md"].decode()
    assert "- F2, MX-64R: 0.92 A continuous, 4.1 A at most, fuse 5 A, wires 0.5 mm²" in text
    assert "- 1: +, 1 A of 10, factor 10" in text and "- 8: D-, signal" in text
    assert len(re.findall(r"^- .* to .*: ", text, re.M)) > 20 and "Do not build" not in text
    assert text.index("## Caution") < text.index("## Power") < text.index("## Wires")
    unsure = wiring_files(scanner_for(*SCANNERS["no ring"]), "0" * 12)["wiring.md"].decode()
    assert "## Unknown" in unsure and "Slip ring" not in unsure


@pytest.mark.parametrize("seed", range(8))
def test_the_servo_is_powered_on_the_bench_by_pins_and_volts_of_its_branch(seed):
    rng, products = np.random.default_rng(seed), load_catalogue().products.values()
    servos, lidars = ([each for each in products if isinstance(each, kind)] for kind in (Servo, Lidar))
    servo, lidar = servos[rng.integers(len(servos))], lidars[rng.integers(len(lidars))]
    scanner = scanner_for(lidar.name, servo.name, None)
    text = wiring_files(scanner, "0" * 12)["wiring.md"].decode()
    volts = 12 if servo.supply_v[0] <= 12 <= servo.supply_v[1] else 5
    bench = text[text.index("## Servo on the bench") : text.index("## Power")]
    assert f"measure {volts} V from V to GND" in bench and "cut one servo cable" in bench
    assert (" for the servo out +" in bench) == (volts == 5)
    assert f"by the pins of its plug, not by colour ({servo.connector}" in text and "1 GND, 2 V, 3 D" in text
    assert f"to 12 V and at least {sum(b.peak_a for b in network_of(scanner).branches):.2g} A" in text
    direct = [each for each in (servo, lidar) if each.supply_v and each.supply_v[0] <= 12 <= each.supply_v[1]]
    battery = re.search(r"A battery within ([\d.]+) to ([\d.]+) V", text)
    assert (battery is None) == (not direct)
    for device in direct:
        assert device.supply_v[0] <= float(battery[1]) + 0.05 and float(battery[2]) <= device.supply_v[1]


@pytest.mark.parametrize("name", ["a tied pin", "a tied pin and no ring"])
def test_a_pin_to_tie_is_a_wire_of_drawing_and_words(name):
    scanner = scanner_for(*SCANNERS[name])
    files = {file: data.decode() for file, data in wiring_files(scanner, "0" * 12).items()}
    lidar = scanner.lidar.name
    assert f"- {lidar} PWM to {lidar} GND: GND, join these two" in files["wiring.md"]
    assert "GND, join these two" in files["wiring.svg"] and "Join pin PWM" in files["wiring.md"]
    picture = ElementTree.fromstring(files["wiring.svg"])
    right = float(picture.get("width"))
    assert max(extent(text)[2] for text in picture.findall(f"{SVG}text")) < right


def test_what_must_not_be_built_and_cautions_stand_above_the_boxes():
    picture = ElementTree.fromstring(schematic_svg(network_of(scanner_for(*SCANNERS["too weak a ring"])), "wiring"))
    boxes = min(float(box.get("y")) for box in picture.findall(f"{SVG}rect")[1:])
    texts = {text.text: float(text.get("y")) for text in picture.findall(f"{SVG}text")}
    (forbidden, *_) = (y for words, y in texts.items() if words.startswith("DO NOT BUILD THIS: ring: circuit 1"))
    (caution, *_) = (y for words, y in texts.items() if words.startswith("CAUTION: "))
    assert forbidden < caution < boxes


def test_cables_that_differ_by_revision_are_measured_and_the_words_tell_how():
    files = wiring_files(scanner_for(*SCANNERS["colours that differ"]), "0" * 12)
    text = files["wiring.md"].decode()
    assert "- UH1256-02-0610-06S 1 + to XH2.54 socket with bare leads +: 5 V, measure first, 1.5 A" in text
    assert "its maker has used black, red, brown, purple for + and white, yellow, orange for -" in text
    assert "set a multimeter to continuity" in text.split("## Power")[0]
