from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Derivatives(_message.Message):
    __slots__ = ("fleet", "vehicle", "time_s", "convention", "estimators")
    class EstimatorsEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: EstimatorModes
        def __init__(self, key: _Optional[str] = ..., value: _Optional[_Union[EstimatorModes, _Mapping]] = ...) -> None: ...
    FLEET_FIELD_NUMBER: _ClassVar[int]
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    TIME_S_FIELD_NUMBER: _ClassVar[int]
    CONVENTION_FIELD_NUMBER: _ClassVar[int]
    ESTIMATORS_FIELD_NUMBER: _ClassVar[int]
    fleet: str
    vehicle: str
    time_s: float
    convention: str
    estimators: _containers.MessageMap[str, EstimatorModes]
    def __init__(self, fleet: _Optional[str] = ..., vehicle: _Optional[str] = ..., time_s: _Optional[float] = ..., convention: _Optional[str] = ..., estimators: _Optional[_Mapping[str, EstimatorModes]] = ...) -> None: ...

class EstimatorModes(_message.Message):
    __slots__ = ("modes",)
    class ModesEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: ModeEstimate
        def __init__(self, key: _Optional[str] = ..., value: _Optional[_Union[ModeEstimate, _Mapping]] = ...) -> None: ...
    MODES_FIELD_NUMBER: _ClassVar[int]
    modes: _containers.MessageMap[str, ModeEstimate]
    def __init__(self, modes: _Optional[_Mapping[str, ModeEstimate]] = ...) -> None: ...

class ModeEstimate(_message.Message):
    __slots__ = ("outcome", "derivatives", "natural_frequency_rad_s", "damping_ratio", "reason", "basis", "natural_frequency_rad_s_standard_error", "damping_ratio_standard_error")
    class DerivativesEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: DerivativeEstimate
        def __init__(self, key: _Optional[str] = ..., value: _Optional[_Union[DerivativeEstimate, _Mapping]] = ...) -> None: ...
    OUTCOME_FIELD_NUMBER: _ClassVar[int]
    DERIVATIVES_FIELD_NUMBER: _ClassVar[int]
    NATURAL_FREQUENCY_RAD_S_FIELD_NUMBER: _ClassVar[int]
    DAMPING_RATIO_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    BASIS_FIELD_NUMBER: _ClassVar[int]
    NATURAL_FREQUENCY_RAD_S_STANDARD_ERROR_FIELD_NUMBER: _ClassVar[int]
    DAMPING_RATIO_STANDARD_ERROR_FIELD_NUMBER: _ClassVar[int]
    outcome: str
    derivatives: _containers.MessageMap[str, DerivativeEstimate]
    natural_frequency_rad_s: float
    damping_ratio: float
    reason: str
    basis: str
    natural_frequency_rad_s_standard_error: float
    damping_ratio_standard_error: float
    def __init__(self, outcome: _Optional[str] = ..., derivatives: _Optional[_Mapping[str, DerivativeEstimate]] = ..., natural_frequency_rad_s: _Optional[float] = ..., damping_ratio: _Optional[float] = ..., reason: _Optional[str] = ..., basis: _Optional[str] = ..., natural_frequency_rad_s_standard_error: _Optional[float] = ..., damping_ratio_standard_error: _Optional[float] = ...) -> None: ...

class DerivativeEstimate(_message.Message):
    __slots__ = ("value", "standard_error", "unit", "outcome", "expected", "expected_standard_error")
    VALUE_FIELD_NUMBER: _ClassVar[int]
    STANDARD_ERROR_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    OUTCOME_FIELD_NUMBER: _ClassVar[int]
    EXPECTED_FIELD_NUMBER: _ClassVar[int]
    EXPECTED_STANDARD_ERROR_FIELD_NUMBER: _ClassVar[int]
    value: float
    standard_error: float
    unit: str
    outcome: str
    expected: float
    expected_standard_error: float
    def __init__(self, value: _Optional[float] = ..., standard_error: _Optional[float] = ..., unit: _Optional[str] = ..., outcome: _Optional[str] = ..., expected: _Optional[float] = ..., expected_standard_error: _Optional[float] = ...) -> None: ...

class Status(_message.Message):
    __slots__ = ("fleet", "vehicle", "aircraft", "configuration", "state", "state_since_s", "reason", "last_sample_time_s", "basis", "basis_text", "worst", "counts", "active_alerts", "condition", "could_see", "unseen_surfaces", "proposed_input")
    class CountsEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: int
        def __init__(self, key: _Optional[str] = ..., value: _Optional[int] = ...) -> None: ...
    class ConditionEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: float
        def __init__(self, key: _Optional[str] = ..., value: _Optional[float] = ...) -> None: ...
    FLEET_FIELD_NUMBER: _ClassVar[int]
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    AIRCRAFT_FIELD_NUMBER: _ClassVar[int]
    CONFIGURATION_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    STATE_SINCE_S_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    LAST_SAMPLE_TIME_S_FIELD_NUMBER: _ClassVar[int]
    BASIS_FIELD_NUMBER: _ClassVar[int]
    BASIS_TEXT_FIELD_NUMBER: _ClassVar[int]
    WORST_FIELD_NUMBER: _ClassVar[int]
    COUNTS_FIELD_NUMBER: _ClassVar[int]
    ACTIVE_ALERTS_FIELD_NUMBER: _ClassVar[int]
    CONDITION_FIELD_NUMBER: _ClassVar[int]
    COULD_SEE_FIELD_NUMBER: _ClassVar[int]
    UNSEEN_SURFACES_FIELD_NUMBER: _ClassVar[int]
    PROPOSED_INPUT_FIELD_NUMBER: _ClassVar[int]
    fleet: str
    vehicle: str
    aircraft: str
    configuration: str
    state: str
    state_since_s: float
    reason: str
    last_sample_time_s: float
    basis: str
    basis_text: str
    worst: WorstDerivative
    counts: _containers.ScalarMap[str, int]
    active_alerts: _containers.RepeatedScalarFieldContainer[str]
    condition: _containers.ScalarMap[str, float]
    could_see: _containers.RepeatedCompositeFieldContainer[CouldSee]
    unseen_surfaces: _containers.RepeatedScalarFieldContainer[str]
    proposed_input: ProposedInput
    def __init__(self, fleet: _Optional[str] = ..., vehicle: _Optional[str] = ..., aircraft: _Optional[str] = ..., configuration: _Optional[str] = ..., state: _Optional[str] = ..., state_since_s: _Optional[float] = ..., reason: _Optional[str] = ..., last_sample_time_s: _Optional[float] = ..., basis: _Optional[str] = ..., basis_text: _Optional[str] = ..., worst: _Optional[_Union[WorstDerivative, _Mapping]] = ..., counts: _Optional[_Mapping[str, int]] = ..., active_alerts: _Optional[_Iterable[str]] = ..., condition: _Optional[_Mapping[str, float]] = ..., could_see: _Optional[_Iterable[_Union[CouldSee, _Mapping]]] = ..., unseen_surfaces: _Optional[_Iterable[str]] = ..., proposed_input: _Optional[_Union[ProposedInput, _Mapping]] = ...) -> None: ...

class ProposedInput(_message.Message):
    __slots__ = ("id", "fleet", "vehicle", "surface", "shape", "amplitude_rad", "width_s", "duration_s", "steps", "why", "proposed_s", "valid_until_s")
    ID_FIELD_NUMBER: _ClassVar[int]
    FLEET_FIELD_NUMBER: _ClassVar[int]
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    SURFACE_FIELD_NUMBER: _ClassVar[int]
    SHAPE_FIELD_NUMBER: _ClassVar[int]
    AMPLITUDE_RAD_FIELD_NUMBER: _ClassVar[int]
    WIDTH_S_FIELD_NUMBER: _ClassVar[int]
    DURATION_S_FIELD_NUMBER: _ClassVar[int]
    STEPS_FIELD_NUMBER: _ClassVar[int]
    WHY_FIELD_NUMBER: _ClassVar[int]
    PROPOSED_S_FIELD_NUMBER: _ClassVar[int]
    VALID_UNTIL_S_FIELD_NUMBER: _ClassVar[int]
    id: str
    fleet: str
    vehicle: str
    surface: str
    shape: str
    amplitude_rad: float
    width_s: float
    duration_s: float
    steps: _containers.RepeatedCompositeFieldContainer[Step]
    why: str
    proposed_s: float
    valid_until_s: float
    def __init__(self, id: _Optional[str] = ..., fleet: _Optional[str] = ..., vehicle: _Optional[str] = ..., surface: _Optional[str] = ..., shape: _Optional[str] = ..., amplitude_rad: _Optional[float] = ..., width_s: _Optional[float] = ..., duration_s: _Optional[float] = ..., steps: _Optional[_Iterable[_Union[Step, _Mapping]]] = ..., why: _Optional[str] = ..., proposed_s: _Optional[float] = ..., valid_until_s: _Optional[float] = ...) -> None: ...

class Step(_message.Message):
    __slots__ = ("start_s", "deflection_rad")
    START_S_FIELD_NUMBER: _ClassVar[int]
    DEFLECTION_RAD_FIELD_NUMBER: _ClassVar[int]
    start_s: float
    deflection_rad: float
    def __init__(self, start_s: _Optional[float] = ..., deflection_rad: _Optional[float] = ...) -> None: ...

class CouldSee(_message.Message):
    __slots__ = ("cause", "channel", "smallest_size", "unit", "input")
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    CHANNEL_FIELD_NUMBER: _ClassVar[int]
    SMALLEST_SIZE_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    INPUT_FIELD_NUMBER: _ClassVar[int]
    cause: str
    channel: str
    smallest_size: float
    unit: str
    input: str
    def __init__(self, cause: _Optional[str] = ..., channel: _Optional[str] = ..., smallest_size: _Optional[float] = ..., unit: _Optional[str] = ..., input: _Optional[str] = ...) -> None: ...

class WorstDerivative(_message.Message):
    __slots__ = ("estimator", "structure", "derivative", "z", "unit", "meaning")
    ESTIMATOR_FIELD_NUMBER: _ClassVar[int]
    STRUCTURE_FIELD_NUMBER: _ClassVar[int]
    DERIVATIVE_FIELD_NUMBER: _ClassVar[int]
    Z_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    MEANING_FIELD_NUMBER: _ClassVar[int]
    estimator: str
    structure: str
    derivative: str
    z: float
    unit: str
    meaning: str
    def __init__(self, estimator: _Optional[str] = ..., structure: _Optional[str] = ..., derivative: _Optional[str] = ..., z: _Optional[float] = ..., unit: _Optional[str] = ..., meaning: _Optional[str] = ...) -> None: ...

class Alert(_message.Message):
    __slots__ = ("id", "fleet", "vehicle", "kind", "cause", "level", "state", "raised_s", "cleared_s", "size", "probability", "basis", "text", "evidence", "notes", "channel", "candidates", "repeats")
    ID_FIELD_NUMBER: _ClassVar[int]
    FLEET_FIELD_NUMBER: _ClassVar[int]
    VEHICLE_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    LEVEL_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    RAISED_S_FIELD_NUMBER: _ClassVar[int]
    CLEARED_S_FIELD_NUMBER: _ClassVar[int]
    SIZE_FIELD_NUMBER: _ClassVar[int]
    PROBABILITY_FIELD_NUMBER: _ClassVar[int]
    BASIS_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    EVIDENCE_FIELD_NUMBER: _ClassVar[int]
    NOTES_FIELD_NUMBER: _ClassVar[int]
    CHANNEL_FIELD_NUMBER: _ClassVar[int]
    CANDIDATES_FIELD_NUMBER: _ClassVar[int]
    REPEATS_FIELD_NUMBER: _ClassVar[int]
    id: str
    fleet: str
    vehicle: str
    kind: str
    cause: str
    level: str
    state: str
    raised_s: float
    cleared_s: float
    size: Size
    probability: float
    basis: str
    text: str
    evidence: _containers.RepeatedCompositeFieldContainer[Evidence]
    notes: _containers.RepeatedScalarFieldContainer[str]
    channel: str
    candidates: _containers.RepeatedCompositeFieldContainer[Candidate]
    repeats: int
    def __init__(self, id: _Optional[str] = ..., fleet: _Optional[str] = ..., vehicle: _Optional[str] = ..., kind: _Optional[str] = ..., cause: _Optional[str] = ..., level: _Optional[str] = ..., state: _Optional[str] = ..., raised_s: _Optional[float] = ..., cleared_s: _Optional[float] = ..., size: _Optional[_Union[Size, _Mapping]] = ..., probability: _Optional[float] = ..., basis: _Optional[str] = ..., text: _Optional[str] = ..., evidence: _Optional[_Iterable[_Union[Evidence, _Mapping]]] = ..., notes: _Optional[_Iterable[str]] = ..., channel: _Optional[str] = ..., candidates: _Optional[_Iterable[_Union[Candidate, _Mapping]]] = ..., repeats: _Optional[int] = ...) -> None: ...

class Candidate(_message.Message):
    __slots__ = ("cause", "channel", "probability")
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    CHANNEL_FIELD_NUMBER: _ClassVar[int]
    PROBABILITY_FIELD_NUMBER: _ClassVar[int]
    cause: str
    channel: str
    probability: float
    def __init__(self, cause: _Optional[str] = ..., channel: _Optional[str] = ..., probability: _Optional[float] = ...) -> None: ...

class Size(_message.Message):
    __slots__ = ("value", "standard_error")
    VALUE_FIELD_NUMBER: _ClassVar[int]
    STANDARD_ERROR_FIELD_NUMBER: _ClassVar[int]
    value: float
    standard_error: float
    def __init__(self, value: _Optional[float] = ..., standard_error: _Optional[float] = ...) -> None: ...

class Evidence(_message.Message):
    __slots__ = ("derivative", "estimate", "standard_error", "expected", "expected_standard_error", "z", "unit", "meaning")
    DERIVATIVE_FIELD_NUMBER: _ClassVar[int]
    ESTIMATE_FIELD_NUMBER: _ClassVar[int]
    STANDARD_ERROR_FIELD_NUMBER: _ClassVar[int]
    EXPECTED_FIELD_NUMBER: _ClassVar[int]
    EXPECTED_STANDARD_ERROR_FIELD_NUMBER: _ClassVar[int]
    Z_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    MEANING_FIELD_NUMBER: _ClassVar[int]
    derivative: str
    estimate: float
    standard_error: float
    expected: float
    expected_standard_error: float
    z: float
    unit: str
    meaning: str
    def __init__(self, derivative: _Optional[str] = ..., estimate: _Optional[float] = ..., standard_error: _Optional[float] = ..., expected: _Optional[float] = ..., expected_standard_error: _Optional[float] = ..., z: _Optional[float] = ..., unit: _Optional[str] = ..., meaning: _Optional[str] = ...) -> None: ...
