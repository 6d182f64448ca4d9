"""From a recording to a cloud: de-skew and its kernel, the axis angle, turns, poses."""
