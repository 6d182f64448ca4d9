"""An unverified value reaches the checks, the drawing and the assembly step of each part that it shapes."""

import json

from scanwright.cad.layout.drive import products_of


def test_each_unverified_value_is_in_checks_drawings_and_steps(made):
    assembly, folder = made.result.assembly, made.folder
    manual = (folder / "assembly.md").read_text()
    checks = json.loads((folder / "checks.json").read_text())["checks"]
    warned = {check["message"].partition(" =")[0] for check in checks if check["kind"] == "unverified"}
    seen = 0
    for product in products_of(made.scanner, assembly.layout.drive):
        for name in assembly.made:
            for field in set(product.unverified()) & set(assembly.parts[name].values_of(product)):
                seen += 1
                assert f"{product.name}: {field}" in warned
                sheet = (folder / f"drawings/{name}.svg").read_text()
                assert "Measure first, no source verifies" in sheet
                assert field in sheet
                assert field in manual
    assert seen > 5
