"""Messages of ROS 2 for cyclonedds, as their interface definitions have them, and qualities of service."""

from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float64, int32, sequence, uint8, uint32
from cyclonedds.util import duration


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Image(IdlStruct, typename="sensor_msgs::msg::dds_::Image_"):
    header: Header
    height: uint32
    width: uint32
    encoding: str
    is_bigendian: uint8
    step: uint32
    data: sequence[uint8]


@dataclass
class CompressedImage(IdlStruct, typename="sensor_msgs::msg::dds_::CompressedImage_"):
    header: Header
    format: str
    data: sequence[uint8]


@dataclass
class CameraInfo(IdlStruct, typename="sensor_msgs::msg::dds_::CameraInfo_"):
    header: Header


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs::msg::dds_::TFMessage_"):
    header: Header


@dataclass
class Odometry(IdlStruct, typename="nav_msgs::msg::dds_::Odometry_"):
    header: Header


@dataclass
class Path(IdlStruct, typename="nav_msgs::msg::dds_::Path_"):
    header: Header


@dataclass
class DiagnosticArray(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticArray_"):
    header: Header


class Raw:
    """The bytes of a message: what stands for a message of any of the types above."""

    def __init__(self, data):
        self.data = bytes(data)


for kind in (Image, CompressedImage, CameraInfo, TFMessage, Odometry, Path, DiagnosticArray):
    # What the types are is their name here; the bytes are made and read by rosbags.
    kind.serialize = lambda self, *arguments, **named: self.raw
    kind.deserialize = classmethod(lambda cls, data, *arguments, **named: Raw(data))


def of(kind, raw):
    """A message of that type with those bytes."""
    message = kind(Header(Time(0, 0), ""))if kind not in (Image, CompressedImage) else kind(
        *([Header(Time(0, 0), "")] + ([0, 0, "", 0, 0, b""] if kind is Image else ["", b""]))
    )
    message.raw = bytes(raw)
    return message


PLAIN = Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False)
SENSOR = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(5), Policy.Durability.Volatile, PLAIN)
RELIABLE = Qos(
    Policy.Reliability.Reliable(duration(milliseconds=100)),
    Policy.History.KeepLast(100),
    Policy.Durability.Volatile,
    PLAIN,
)
STATIC = Qos(
    Policy.Reliability.Reliable(duration(milliseconds=100)),
    Policy.History.KeepLast(1),
    Policy.Durability.TransientLocal,
    Policy.DurabilityService(0, Policy.History.KeepLast(1), 1000, 1, 1000),
    PLAIN,
)
