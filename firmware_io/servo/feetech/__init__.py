"""Packets and control tables of Feetech STS and SMS."""
