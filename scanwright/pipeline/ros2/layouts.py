"""Layouts for RViz and Foxglove: description, points of one turn, frames."""

from __future__ import annotations

import json

_LEAST_DECAY_S = 1.0  # points of a sweep or a stop stay visible
_RVIZ = """Panels:
  - Class: rviz_common/Displays
    Name: Displays
  - Class: rviz_common/Time
    Name: Time
Visualization Manager:
  Class: ""
  Global Options:
    Background Color: 40; 40; 44
    Fixed Frame: world
    Frame Rate: 30
  Displays:
    - Class: rviz_default_plugins/Grid
      Name: Grid
      Enabled: true
    - Class: rviz_default_plugins/RobotModel
      Name: Scanner
      Enabled: true
      Description Source: Topic
      Description Topic:
        Value: /robot_description
        Durability Policy: Transient Local
        Reliability Policy: Reliable
    - Class: rviz_default_plugins/TF
      Name: Frames
      Enabled: true
      Marker Scale: 0.3
    - Class: rviz_default_plugins/PointCloud2
      Name: Points
      Enabled: true
      Decay Time: {decay_s:g}
      Style: Points
      Size (Pixels): 2
      Color Transformer: AxisColor
      Axis: Z
      Topic:
        Value: /points
        Depth: 50
        Reliability Policy: Reliable
    - Class: rviz_default_plugins/LaserScan
      Name: Scan
      Enabled: true
      Style: Points
      Size (Pixels): 3
      Color Transformer: FlatColor
      Color: 255; 80; 60
      Topic:
        Value: /scan
        Reliability Policy: Reliable
  Tools:
    - Class: rviz_default_plugins/MoveCamera
  Views:
    Current:
      Class: rviz_default_plugins/Orbit
      Distance: 8
      Pitch: 0.6
      Yaw: 0.8
"""


def rviz_layout(period_s: float) -> str:
    """Return a configuration of RViz; points stay for one turn of `period_s` (0 if the axis does not spin)."""
    return _RVIZ.format(decay_s=max(period_s, _LEAST_DECAY_S))


def foxglove_layout(period_s: float) -> str:
    """Return a layout to import in Foxglove; points stay as in RViz."""
    points = {
        "visible": True,
        "colorField": "z",
        "colorMode": "colormap",
        "colorMap": "turbo",
        "pointSize": 2,
        "decayTime": max(period_s, _LEAST_DECAY_S),
    }
    description = {
        "layerId": "foxglove.Urdf",
        "instanceId": "scanner",
        "label": "Scanner",
        "visible": True,
        "sourceType": "topic",
        "topic": "/robot_description",
    }
    scene = {
        "followTf": "world",
        "cameraState": {"perspective": True, "distance": 8, "phi": 60, "thetaOffset": 45, "targetOffset": [0, 0, 0]},
        "topics": {"/points": points, "/scan": {"visible": True, "pointSize": 3}},
        "layers": {"scanner": description},
    }
    angle = {"paths": [{"value": "/joint_states.position[0]", "enabled": True, "timestampMethod": "headerStamp"}]}
    layout = {
        "configById": {"3D!scanner": scene, "Plot!angle": angle},
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {"first": "3D!scanner", "second": "Plot!angle", "direction": "column", "splitPercentage": 75},
    }
    return json.dumps(layout, indent=2) + "\n"
