"""Protocol and driver of Slamtec RPLIDAR A, S and C."""
