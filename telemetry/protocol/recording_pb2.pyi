from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class RecordedEstimate(_message.Message):
    __slots__ = ("time_s", "outcome", "derivatives", "covariance", "airspeed_true_m_s", "altitude_m", "air_density_kg_m3", "angle_of_attack_rad", "aircraft", "configuration")
    TIME_S_FIELD_NUMBER: _ClassVar[int]
    OUTCOME_FIELD_NUMBER: _ClassVar[int]
    DERIVATIVES_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    AIRSPEED_TRUE_M_S_FIELD_NUMBER: _ClassVar[int]
    ALTITUDE_M_FIELD_NUMBER: _ClassVar[int]
    AIR_DENSITY_KG_M3_FIELD_NUMBER: _ClassVar[int]
    ANGLE_OF_ATTACK_RAD_FIELD_NUMBER: _ClassVar[int]
    AIRCRAFT_FIELD_NUMBER: _ClassVar[int]
    CONFIGURATION_FIELD_NUMBER: _ClassVar[int]
    time_s: float
    outcome: str
    derivatives: _containers.RepeatedCompositeFieldContainer[RecordedDerivative]
    covariance: _containers.RepeatedScalarFieldContainer[float]
    airspeed_true_m_s: float
    altitude_m: float
    air_density_kg_m3: float
    angle_of_attack_rad: float
    aircraft: str
    configuration: str
    def __init__(self, time_s: _Optional[float] = ..., outcome: _Optional[str] = ..., derivatives: _Optional[_Iterable[_Union[RecordedDerivative, _Mapping]]] = ..., covariance: _Optional[_Iterable[float]] = ..., airspeed_true_m_s: _Optional[float] = ..., altitude_m: _Optional[float] = ..., air_density_kg_m3: _Optional[float] = ..., angle_of_attack_rad: _Optional[float] = ..., aircraft: _Optional[str] = ..., configuration: _Optional[str] = ...) -> None: ...

class RecordedDerivative(_message.Message):
    __slots__ = ("symbol", "value", "standard_error")
    SYMBOL_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    STANDARD_ERROR_FIELD_NUMBER: _ClassVar[int]
    symbol: str
    value: float
    standard_error: float
    def __init__(self, symbol: _Optional[str] = ..., value: _Optional[float] = ..., standard_error: _Optional[float] = ...) -> None: ...
