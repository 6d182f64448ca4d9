"""Printed output in the pages comes from runs."""
