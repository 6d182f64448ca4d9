"""The families of servos, and their products."""

from design.catalogue.catalogue import load_catalogue
from design.catalogue.products import Servo
from firmware_io.servo import families


def test_every_model_has_a_product():
    for table in families.all_tables():
        assert load_catalogue().get(table.model, Servo).name == table.model
