"""Replay in ROS 2, which is not here: the launch file against stand-ins, names and types against the recording."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from benchmarks.firmware_io.rooms import FURNISHED, Setup, Truth, simulate, write

LAUNCH = Path(__file__).parents[3] / "firmware_io/ros/replay_launch.py"


class Told:
    """Anything of launch: what it is and what it was given."""

    def __init__(self, *given, **named):
        self.given, self.named = given, named


def described(monkeypatch):
    """The actions of the launch file."""
    names = {
        "launch": ["LaunchDescription"],
        "launch.actions": ["DeclareLaunchArgument", "ExecuteProcess"],
        "launch.substitutions": ["Command", "LaunchConfiguration"],
        "launch_ros": [],
        "launch_ros.actions": ["Node"],
        "launch_ros.parameter_descriptions": ["ParameterValue"],
    }
    for module, classes in names.items():
        stand_in = ModuleType(module)
        for name in classes:
            setattr(stand_in, name, type(name, (Told,), {}))
        monkeypatch.setitem(sys.modules, module, stand_in)
    spec = importlib.util.spec_from_file_location("replay_launch", LAUNCH)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.generate_launch_description().given[0]


def test_the_launch_file_plays_the_recording_beside_a_state_publisher(monkeypatch):
    *arguments, node, player = described(monkeypatch)
    assert [argument.given[0] for argument in arguments] == ["recording", "urdf"]
    assert node.named["package"] == node.named["executable"] == "robot_state_publisher"
    (parameters,) = node.named["parameters"]
    assert parameters["use_sim_time"] is True
    assert parameters["robot_description"].given[0].given[0][1].given == ("urdf",)
    *words, last = player.named["cmd"]
    assert words == ["ros2", "bag", "play", "-s", "mcap", "--clock", "100"]
    assert last.given == ("recording",)


def test_the_recording_says_what_a_state_publisher_expects(tmp_path):
    setup = Setup(beams=20, sweeps=((180.0, 30.0),))
    path = write(tmp_path / "r.mcap", simulate(FURNISHED, setup, Truth()))
    with path.open("rb") as stream:
        messages = list(make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages())
    kinds = {(channel.topic, schema.name, schema.encoding) for schema, channel, _, _ in messages}
    assert kinds == {
        ("/scan", "sensor_msgs/msg/LaserScan", "ros2msg"),
        ("/joint_states", "sensor_msgs/msg/JointState", "ros2msg"),
    }
    assert {channel.message_encoding for _, channel, _, _ in messages} == {"cdr"}
    joints = {name for schema, _, _, said in messages if schema.name.endswith("JointState") for name in said.name}
    scans = {said.header.frame_id for schema, _, _, said in messages if schema.name.endswith("LaserScan")}
    assert np.all(np.diff([message.log_time for _, _, message, _ in messages]) >= 0)
    assert (joints, scans) == ({"spin_joint"}, {"laser"})
