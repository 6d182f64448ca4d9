"""The families of lidars, and which of them drives a product of the catalogue."""

from dataclasses import replace

import pytest

from design.catalogue.catalogue import load_catalogue
from design.catalogue.products import Lidar
from design.errors import DeviceError
from firmware_io.lidar import families
from firmware_io.lidar.families import family_of


def test_a_lidar_that_nothing_drives_is_one_line(monkeypatch):
    catalogue = load_catalogue()
    undriven = {"LMS 200": catalogue.get("LMS 200", Lidar).model_copy(update={"family": None})}
    monkeypatch.setattr(families, "load_catalogue", lambda: replace(catalogue, products=catalogue.products | undriven))
    with pytest.raises(DeviceError, match="LMS 200: no driver"):
        family_of("LMS 200")


def test_every_family_of_the_catalogue_is_one():
    lidars = [product for product in load_catalogue() if isinstance(product, Lidar) and product.family]
    assert {product.family for product in lidars} == {family.name for family in families.FAMILIES}
