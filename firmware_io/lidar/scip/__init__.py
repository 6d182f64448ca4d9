"""Protocol and driver of Hokuyo's SCIP 2.0."""
