"""The families of servos, and their products."""

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.servo import Servo
from scanwright.firmware_io.servo import families


def test_every_model_has_a_product():
    for table in families.all_tables():
        assert load_catalogue().get(table.model, Servo).name == table.model
