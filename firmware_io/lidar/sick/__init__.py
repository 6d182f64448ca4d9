"""SICK's CoLa: framing in both dialects, the scan telegram, and the driver of TiM and LMS1xx."""
