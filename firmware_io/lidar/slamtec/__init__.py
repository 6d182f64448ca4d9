"""RPLIDAR A, S and C: requests, descriptors, and streams of nodes, capsules or dense capsules."""
