from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Sensors(_message.Message):
    __slots__ = ("sequence", "columns", "stream")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    COLUMNS_FIELD_NUMBER: _ClassVar[int]
    STREAM_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    columns: SensorColumns
    stream: int
    def __init__(self, sequence: _Optional[int] = ..., columns: _Optional[_Union[SensorColumns, _Mapping]] = ..., stream: _Optional[int] = ...) -> None: ...

class SensorColumns(_message.Message):
    __slots__ = ("time_s", "airspeed_true_m_s", "airspeed_indicated_m_s", "roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s", "specific_force_x_m_s2", "specific_force_y_m_s2", "specific_force_z_m_s2", "roll_rad", "pitch_rad", "heading_rad", "elevator_rad", "aileron_rad", "rudder_rad", "angle_of_attack_rad", "sideslip_rad", "throttle", "altitude_m", "air_density_kg_m3", "outside_air_temperature_k", "elevator_command_rad", "aileron_command_rad", "rudder_command_rad", "aileron_left_rad", "aileron_right_rad", "roll_demand_rad", "pitch_demand_rad", "airspeed_demand_m_s", "altitude_demand_m", "velocity_north_m_s", "velocity_east_m_s", "velocity_down_m_s", "latitude_deg", "longitude_deg")
    TIME_S_FIELD_NUMBER: _ClassVar[int]
    AIRSPEED_TRUE_M_S_FIELD_NUMBER: _ClassVar[int]
    AIRSPEED_INDICATED_M_S_FIELD_NUMBER: _ClassVar[int]
    ROLL_RATE_RAD_S_FIELD_NUMBER: _ClassVar[int]
    PITCH_RATE_RAD_S_FIELD_NUMBER: _ClassVar[int]
    YAW_RATE_RAD_S_FIELD_NUMBER: _ClassVar[int]
    SPECIFIC_FORCE_X_M_S2_FIELD_NUMBER: _ClassVar[int]
    SPECIFIC_FORCE_Y_M_S2_FIELD_NUMBER: _ClassVar[int]
    SPECIFIC_FORCE_Z_M_S2_FIELD_NUMBER: _ClassVar[int]
    ROLL_RAD_FIELD_NUMBER: _ClassVar[int]
    PITCH_RAD_FIELD_NUMBER: _ClassVar[int]
    HEADING_RAD_FIELD_NUMBER: _ClassVar[int]
    ELEVATOR_RAD_FIELD_NUMBER: _ClassVar[int]
    AILERON_RAD_FIELD_NUMBER: _ClassVar[int]
    RUDDER_RAD_FIELD_NUMBER: _ClassVar[int]
    ANGLE_OF_ATTACK_RAD_FIELD_NUMBER: _ClassVar[int]
    SIDESLIP_RAD_FIELD_NUMBER: _ClassVar[int]
    THROTTLE_FIELD_NUMBER: _ClassVar[int]
    ALTITUDE_M_FIELD_NUMBER: _ClassVar[int]
    AIR_DENSITY_KG_M3_FIELD_NUMBER: _ClassVar[int]
    OUTSIDE_AIR_TEMPERATURE_K_FIELD_NUMBER: _ClassVar[int]
    ELEVATOR_COMMAND_RAD_FIELD_NUMBER: _ClassVar[int]
    AILERON_COMMAND_RAD_FIELD_NUMBER: _ClassVar[int]
    RUDDER_COMMAND_RAD_FIELD_NUMBER: _ClassVar[int]
    AILERON_LEFT_RAD_FIELD_NUMBER: _ClassVar[int]
    AILERON_RIGHT_RAD_FIELD_NUMBER: _ClassVar[int]
    ROLL_DEMAND_RAD_FIELD_NUMBER: _ClassVar[int]
    PITCH_DEMAND_RAD_FIELD_NUMBER: _ClassVar[int]
    AIRSPEED_DEMAND_M_S_FIELD_NUMBER: _ClassVar[int]
    ALTITUDE_DEMAND_M_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_NORTH_M_S_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_EAST_M_S_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_DOWN_M_S_FIELD_NUMBER: _ClassVar[int]
    LATITUDE_DEG_FIELD_NUMBER: _ClassVar[int]
    LONGITUDE_DEG_FIELD_NUMBER: _ClassVar[int]
    time_s: _containers.RepeatedScalarFieldContainer[float]
    airspeed_true_m_s: _containers.RepeatedScalarFieldContainer[float]
    airspeed_indicated_m_s: _containers.RepeatedScalarFieldContainer[float]
    roll_rate_rad_s: _containers.RepeatedScalarFieldContainer[float]
    pitch_rate_rad_s: _containers.RepeatedScalarFieldContainer[float]
    yaw_rate_rad_s: _containers.RepeatedScalarFieldContainer[float]
    specific_force_x_m_s2: _containers.RepeatedScalarFieldContainer[float]
    specific_force_y_m_s2: _containers.RepeatedScalarFieldContainer[float]
    specific_force_z_m_s2: _containers.RepeatedScalarFieldContainer[float]
    roll_rad: _containers.RepeatedScalarFieldContainer[float]
    pitch_rad: _containers.RepeatedScalarFieldContainer[float]
    heading_rad: _containers.RepeatedScalarFieldContainer[float]
    elevator_rad: _containers.RepeatedScalarFieldContainer[float]
    aileron_rad: _containers.RepeatedScalarFieldContainer[float]
    rudder_rad: _containers.RepeatedScalarFieldContainer[float]
    angle_of_attack_rad: _containers.RepeatedScalarFieldContainer[float]
    sideslip_rad: _containers.RepeatedScalarFieldContainer[float]
    throttle: _containers.RepeatedScalarFieldContainer[float]
    altitude_m: _containers.RepeatedScalarFieldContainer[float]
    air_density_kg_m3: _containers.RepeatedScalarFieldContainer[float]
    outside_air_temperature_k: _containers.RepeatedScalarFieldContainer[float]
    elevator_command_rad: _containers.RepeatedScalarFieldContainer[float]
    aileron_command_rad: _containers.RepeatedScalarFieldContainer[float]
    rudder_command_rad: _containers.RepeatedScalarFieldContainer[float]
    aileron_left_rad: _containers.RepeatedScalarFieldContainer[float]
    aileron_right_rad: _containers.RepeatedScalarFieldContainer[float]
    roll_demand_rad: _containers.RepeatedScalarFieldContainer[float]
    pitch_demand_rad: _containers.RepeatedScalarFieldContainer[float]
    airspeed_demand_m_s: _containers.RepeatedScalarFieldContainer[float]
    altitude_demand_m: _containers.RepeatedScalarFieldContainer[float]
    velocity_north_m_s: _containers.RepeatedScalarFieldContainer[float]
    velocity_east_m_s: _containers.RepeatedScalarFieldContainer[float]
    velocity_down_m_s: _containers.RepeatedScalarFieldContainer[float]
    latitude_deg: _containers.RepeatedScalarFieldContainer[float]
    longitude_deg: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, time_s: _Optional[_Iterable[float]] = ..., airspeed_true_m_s: _Optional[_Iterable[float]] = ..., airspeed_indicated_m_s: _Optional[_Iterable[float]] = ..., roll_rate_rad_s: _Optional[_Iterable[float]] = ..., pitch_rate_rad_s: _Optional[_Iterable[float]] = ..., yaw_rate_rad_s: _Optional[_Iterable[float]] = ..., specific_force_x_m_s2: _Optional[_Iterable[float]] = ..., specific_force_y_m_s2: _Optional[_Iterable[float]] = ..., specific_force_z_m_s2: _Optional[_Iterable[float]] = ..., roll_rad: _Optional[_Iterable[float]] = ..., pitch_rad: _Optional[_Iterable[float]] = ..., heading_rad: _Optional[_Iterable[float]] = ..., elevator_rad: _Optional[_Iterable[float]] = ..., aileron_rad: _Optional[_Iterable[float]] = ..., rudder_rad: _Optional[_Iterable[float]] = ..., angle_of_attack_rad: _Optional[_Iterable[float]] = ..., sideslip_rad: _Optional[_Iterable[float]] = ..., throttle: _Optional[_Iterable[float]] = ..., altitude_m: _Optional[_Iterable[float]] = ..., air_density_kg_m3: _Optional[_Iterable[float]] = ..., outside_air_temperature_k: _Optional[_Iterable[float]] = ..., elevator_command_rad: _Optional[_Iterable[float]] = ..., aileron_command_rad: _Optional[_Iterable[float]] = ..., rudder_command_rad: _Optional[_Iterable[float]] = ..., aileron_left_rad: _Optional[_Iterable[float]] = ..., aileron_right_rad: _Optional[_Iterable[float]] = ..., roll_demand_rad: _Optional[_Iterable[float]] = ..., pitch_demand_rad: _Optional[_Iterable[float]] = ..., airspeed_demand_m_s: _Optional[_Iterable[float]] = ..., altitude_demand_m: _Optional[_Iterable[float]] = ..., velocity_north_m_s: _Optional[_Iterable[float]] = ..., velocity_east_m_s: _Optional[_Iterable[float]] = ..., velocity_down_m_s: _Optional[_Iterable[float]] = ..., latitude_deg: _Optional[_Iterable[float]] = ..., longitude_deg: _Optional[_Iterable[float]] = ...) -> None: ...

class Aircraft(_message.Message):
    __slots__ = ("aircraft", "configuration", "mass_kg", "cg_shift_m", "stream")
    AIRCRAFT_FIELD_NUMBER: _ClassVar[int]
    CONFIGURATION_FIELD_NUMBER: _ClassVar[int]
    MASS_KG_FIELD_NUMBER: _ClassVar[int]
    CG_SHIFT_M_FIELD_NUMBER: _ClassVar[int]
    STREAM_FIELD_NUMBER: _ClassVar[int]
    aircraft: str
    configuration: str
    mass_kg: float
    cg_shift_m: float
    stream: int
    def __init__(self, aircraft: _Optional[str] = ..., configuration: _Optional[str] = ..., mass_kg: _Optional[float] = ..., cg_shift_m: _Optional[float] = ..., stream: _Optional[int] = ...) -> None: ...
