"""RPLIDARs in software: models and their scan modes, packets, and the sensor itself."""
