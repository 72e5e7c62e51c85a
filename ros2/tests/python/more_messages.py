"""Messages of a map, of a gyroscope and of a clock for cyclonedds, as their interface definitions have them."""

from dataclasses import dataclass

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float32, float64, int8, int32, sequence, uint8, uint32
from rosbags.typesys import get_types_from_msg

import messages

UPDATE = "std_msgs/Header header\nint32 x\nint32 y\nuint32 width\nuint32 height\nint8[] data\n"


@dataclass
class InitialPose(IdlStruct, typename="geometry_msgs::msg::dds_::PoseWithCovarianceStamped_"):
    header: messages.Header
    pose: messages.PoseWithCovariance


@dataclass
class PointField(IdlStruct, typename="sensor_msgs::msg::dds_::PointField_"):
    name: str
    offset: uint32
    datatype: uint8
    count: uint32


@dataclass
class PointCloud2(IdlStruct, typename="sensor_msgs::msg::dds_::PointCloud2_"):
    header: messages.Header
    height: uint32
    width: uint32
    fields: sequence[PointField]
    is_bigendian: bool
    point_step: uint32
    row_step: uint32
    data: sequence[uint8]
    is_dense: bool


@dataclass
class MapMetaData(IdlStruct, typename="nav_msgs::msg::dds_::MapMetaData_"):
    map_load_time: messages.Time
    resolution: float32
    width: uint32
    height: uint32
    origin: messages.Pose


@dataclass
class OccupancyGrid(IdlStruct, typename="nav_msgs::msg::dds_::OccupancyGrid_"):
    header: messages.Header
    info: MapMetaData
    data: sequence[int8]


@dataclass
class OccupancyGridUpdate(IdlStruct, typename="map_msgs::msg::dds_::OccupancyGridUpdate_"):
    header: messages.Header
    x: int32
    y: int32
    width: uint32
    height: uint32
    data: sequence[int8]


@dataclass
class Imu(IdlStruct, typename="sensor_msgs::msg::dds_::Imu_"):
    header: messages.Header
    orientation: messages.Quaternion
    orientation_covariance: array[float64, 9]
    angular_velocity: messages.Vector3
    angular_velocity_covariance: array[float64, 9]
    linear_acceleration: messages.Vector3
    linear_acceleration_covariance: array[float64, 9]


@dataclass
class Clock(IdlStruct, typename="rosgraph_msgs::msg::dds_::Clock_"):
    clock: messages.Time


messages.raw(Clock, InitialPose, PointCloud2, OccupancyGrid, OccupancyGridUpdate, Imu)


def register(store):
    """Teaches rosbags the types that its stores lack."""
    store.register(get_types_from_msg(UPDATE, "map_msgs/msg/OccupancyGridUpdate"))
