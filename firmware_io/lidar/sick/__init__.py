"""CoLa protocol and driver of SICK TiM and LMS1xx."""
