import os
from typing import Any, Callable, Mapping, Optional, Sequence, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import study as study

__version__: str

Path = Union[str, "os.PathLike[str]"]
Information = Union[ArrayLike, Path, "InformationSet"]
Progress = Union[None, bool, Callable[[str], None]]
Model = Union[Path, Mapping[str, Any]]
Signal = Union[Tuple[ArrayLike, str], Mapping[str, Any]]
Recordings = Union[Path, "Recording", Sequence["Recording"]]
Numbers = Union[float, Path, ArrayLike]

class InputError(ValueError): ...

class Interrupted(KeyboardInterrupt):
    result: Any

class InformationSet:
    def __init__(
        self,
        source: Union[ArrayLike, Path],
        *,
        parameters: Optional[Sequence[str]] = ...,
        coordinates: Optional[ArrayLike] = ...,
        coordinate_names: Optional[Sequence[str]] = ...,
        psd_tolerance: float = ...,
        singular: bool = ...,
        variable: str = ...,
        factors: bool = ...,
    ) -> None: ...
    @property
    def candidates(self) -> int: ...
    @property
    def dimension(self) -> int: ...
    @property
    def name(self) -> str: ...
    @property
    def parameters(self) -> list[str]: ...
    @property
    def content_hash(self) -> str: ...
    @property
    def note(self) -> str: ...
    @property
    def factors(self) -> Optional[NDArray[np.float64]]: ...
    @property
    def has_matrices(self) -> bool: ...
    @property
    def packed(self) -> NDArray[np.float64]: ...
    def save(self, path: Path) -> None: ...
    def __len__(self) -> int: ...

class Certificate:
    status: str
    gap: float
    rounding_bound: float
    log_det: float
    criterion_value: float
    log_det_gap: float
    efficiency: float
    worst_candidate: int
    support_size: int
    clipped: float
    renormalised: float
    violation: float
    proves_gap: Optional[bool]
    floors: list[dict[str, Any]]
    message: str
    @property
    def bound(self) -> float: ...
    def proves(self, gap: float) -> bool: ...
    def _repr_html_(self) -> str: ...

class ExactCertificate:
    status: str
    experiments: int
    support_size: int
    log_det: float
    criterion_value: Optional[float]
    rounding_bound: float
    bound: float
    efficiency: float
    message: str
    def _repr_html_(self) -> str: ...

class Design:
    weights: Optional[NDArray[np.float64]]
    efforts: Optional[NDArray[np.float64]]
    multipliers: Optional[NDArray[np.float64]]
    floors: list[dict[str, Any]]
    dual_matrix: Optional[NDArray[np.float64]]
    trace: NDArray[np.float64]
    certificate: Certificate
    solver: str
    status: str
    message: str
    criterion: str
    asked_gap: float
    seconds: float
    passes: float
    iterations: int
    @property
    def solved(self) -> bool: ...
    @property
    def support(self) -> NDArray[np.intp]: ...
    @property
    def gap(self) -> float: ...
    @property
    def rounding_bound(self) -> float: ...
    @property
    def log_det(self) -> float: ...
    @property
    def bound(self) -> float: ...
    @property
    def efficiency(self) -> float: ...
    def certify(self, **changes: Any) -> Certificate: ...
    def save(self, path: Path) -> None: ...
    def _repr_html_(self) -> str: ...

class ContinuousDesign:
    points: NDArray[np.float64]
    weights: NDArray[np.float64]
    log_det: float
    found_gap: float
    grid_log_det: float
    status: str
    rounds: int
    certificate: Certificate
    def _repr_html_(self) -> str: ...

class ExactDesign:
    counts: Optional[NDArray[np.int64]]
    designs: list[NDArray[np.int64]]
    status: str
    message: str
    criterion_value: float
    log_det: float
    bound: Optional[float]
    efficiency: float
    stated_efficiency: Optional[float]
    nodes: int
    seconds: float
    @property
    def optimal(self) -> bool: ...
    @property
    def support(self) -> NDArray[np.intp]: ...
    def certify(self) -> ExactCertificate: ...
    def save(self, path: Path) -> None: ...
    def _repr_html_(self) -> str: ...

class Plan:
    status: str
    experiments: int
    least: Optional[int]
    cost: Optional[float]
    least_cost: Optional[float]
    at_most: int
    counts: Optional[NDArray[np.int64]]
    targets: list[dict[str, Any]]
    worst_ratio: float
    message: str
    @property
    def proven(self) -> bool: ...
    @property
    def support(self) -> NDArray[np.intp]: ...
    def _repr_html_(self) -> str: ...

class RobustDesign:
    weights: Optional[NDArray[np.float64]]
    certificate: Certificate
    solver: str
    status: str
    message: str
    objective: str
    value: float
    log_dets: NDArray[np.float64]
    optima: NDArray[np.float64]
    efficiencies: NDArray[np.float64]
    prices: NDArray[np.float64]
    asked_gap: float
    seconds: float
    passes: float
    iterations: int
    @property
    def solved(self) -> bool: ...
    @property
    def support(self) -> NDArray[np.intp]: ...
    @property
    def gap(self) -> float: ...
    @property
    def efficiency(self) -> float: ...
    def certify(self) -> Certificate: ...
    def _repr_html_(self) -> str: ...

class ConcentratedDesign:
    weights: Optional[NDArray[np.float64]]
    certificate: Certificate
    solver: str
    status: str
    message: str
    largest_share: float
    of: int
    concentration: float
    price: float
    asked_gap: float
    seconds: float
    passes: float
    iterations: int
    @property
    def solved(self) -> bool: ...
    @property
    def support(self) -> NDArray[np.intp]: ...
    @property
    def gap(self) -> float: ...
    @property
    def log_det(self) -> float: ...
    @property
    def efficiency(self) -> float: ...
    def certify(self) -> Certificate: ...
    def _repr_html_(self) -> str: ...

class SpectrumDesign:
    weights: NDArray[np.float64]
    shares: NDArray[np.float64]
    coordinates: NDArray[np.float64]
    coordinate_names: list[str]
    information: InformationSet
    covariance: float
    lines: int
    position_limit: float
    certificate: Certificate
    status: str
    message: str
    asked_gap: float
    seconds: float
    passes: float
    iterations: int
    @property
    def positions(self) -> NDArray[np.intp]: ...
    @property
    def solved(self) -> bool: ...
    @property
    def support(self) -> NDArray[np.intp]: ...
    @property
    def gap(self) -> float: ...
    @property
    def log_det(self) -> float: ...
    @property
    def efficiency(self) -> float: ...
    def _repr_html_(self) -> str: ...

class SequentialStudy:
    data: dict[str, Any]
    repetitions: int
    asked_repetitions: int
    parameters: list[str]
    records: list[dict[str, Any]]
    summary: list[dict[str, Any]]
    def __getattr__(self, name: str) -> Any: ...
    def to_json(self) -> str: ...
    def _repr_html_(self) -> str: ...

def solve(
    H: Information,
    criterion: Union[str, Mapping[str, float]] = ...,
    *,
    gap: float = ...,
    solver: str = ...,
    W: Optional[ArrayLike] = ...,
    interest: Optional[Sequence[Union[str, int]]] = ...,
    region: Any = ...,
    p: Optional[float] = ...,
    floor: Optional[Mapping[str, float]] = ...,
    start: Optional[ArrayLike] = ...,
    time_limit: Optional[float] = ...,
    iteration_limit: int = ...,
    seed: int = ...,
    threads: int = ...,
    psd_tolerance: float = ...,
    factors: bool = ...,
    progress: Progress = ...,
    request: Optional[Path] = ...,
    experiments: Optional[float] = ...,
    budget: Optional[float] = ...,
    prior: Union[None, Path, ArrayLike] = ...,
    done: Union[None, Numbers, ExactDesign] = ...,
    costs: Optional[Numbers] = ...,
    stock: Optional[Numbers] = ...,
    require: Optional[str] = ...,
    forbid: Optional[str] = ...,
    block_sizes: Union[None, str, Sequence[int]] = ...,
    constraints: Union[None, Path, Sequence[Mapping[str, Any]]] = ...,
    A_ub: Optional[ArrayLike] = ...,
    b_ub: Optional[ArrayLike] = ...,
    A_eq: Optional[ArrayLike] = ...,
    b_eq: Optional[ArrayLike] = ...,
) -> Design: ...
def certify(
    H: Information,
    weights: Union[ArrayLike, Design],
    criterion: Union[str, Mapping[str, float]] = ...,
    *,
    gap: float = ...,
    W: Optional[ArrayLike] = ...,
    interest: Optional[Sequence[Union[str, int]]] = ...,
    region: Any = ...,
    p: Optional[float] = ...,
    floor: Optional[Mapping[str, float]] = ...,
    floor_multipliers: Optional[Mapping[str, float]] = ...,
    dual_matrix: Optional[ArrayLike] = ...,
    psd_tolerance: float = ...,
    factors: bool = ...,
    **request: Any,
) -> Certificate: ...
def exact(
    H: Information,
    experiments: Optional[float] = ...,
    criterion: Union[str, Mapping[str, float]] = ...,
    *,
    method: str = ...,
    gap: float = ...,
    W: Optional[ArrayLike] = ...,
    interest: Optional[Sequence[Union[str, int]]] = ...,
    region: Any = ...,
    p: Optional[float] = ...,
    top: int = ...,
    time_limit: Optional[float] = ...,
    seed: int = ...,
    threads: int = ...,
    psd_tolerance: float = ...,
    factors: bool = ...,
    progress: Progress = ...,
    **request: Any,
) -> ExactDesign: ...
def candidates(
    function: Callable[[NDArray[np.float64]], ArrayLike],
    points: ArrayLike,
    *,
    noise: Optional[ArrayLike] = ...,
    parameters: Optional[Sequence[str]] = ...,
    names: Optional[Sequence[str]] = ...,
) -> InformationSet: ...
def continuous(
    function: Callable[[NDArray[np.float64]], ArrayLike],
    lower: ArrayLike,
    upper: ArrayLike,
    grid: Union[ArrayLike, InformationSet],
    *,
    noise: Optional[ArrayLike] = ...,
    gap: float = ...,
    random_points: int = ...,
    seed: int = ...,
    progress: Progress = ...,
) -> ContinuousDesign: ...
def certify_exact(
    H: Information,
    counts: Union[ArrayLike, ExactDesign],
    criterion: Union[str, Mapping[str, float]] = ...,
    *,
    bound: float = ...,
    W: Optional[ArrayLike] = ...,
    interest: Optional[Sequence[Union[str, int]]] = ...,
    region: Any = ...,
    p: Optional[float] = ...,
    psd_tolerance: float = ...,
    factors: bool = ...,
    **request: Any,
) -> ExactCertificate: ...
def load_design(
    H: Information,
    path: Path,
    *,
    gap: Optional[float] = ...,
    psd_tolerance: float = ...,
    factors: bool = ...,
) -> Union[Design, ExactDesign]: ...
def plan(
    H: Information,
    targets: Union[str, Sequence[str]] = ...,
    *,
    detect: Union[str, Sequence[str]] = ...,
    power: float = ...,
    level: float = ...,
    noise: float = ...,
    at_most: int = ...,
    gap: float = ...,
    time_limit: Optional[float] = ...,
    seed: int = ...,
    threads: int = ...,
    psd_tolerance: float = ...,
    factors: bool = ...,
    progress: Progress = ...,
    prior: Union[None, Path, ArrayLike] = ...,
    done: Optional[Numbers] = ...,
    costs: Optional[Numbers] = ...,
    budget: Optional[float] = ...,
    stock: Optional[Numbers] = ...,
    require: Optional[str] = ...,
    forbid: Optional[str] = ...,
    constraints: Union[None, Path, Sequence[Mapping[str, Any]]] = ...,
    A_ub: Optional[ArrayLike] = ...,
    b_ub: Optional[ArrayLike] = ...,
    A_eq: Optional[ArrayLike] = ...,
    b_eq: Optional[ArrayLike] = ...,
) -> Plan: ...
def precision_curve(
    H: Information,
    experiments: Sequence[int],
    targets: Union[str, Sequence[str]] = ...,
    *,
    detect: Union[str, Sequence[str]] = ...,
    power: float = ...,
    level: float = ...,
    noise: float = ...,
    time_limit: Optional[float] = ...,
    seed: int = ...,
    threads: int = ...,
    psd_tolerance: float = ...,
    factors: bool = ...,
    progress: Progress = ...,
    prior: Union[None, Path, ArrayLike] = ...,
    done: Optional[Numbers] = ...,
    stock: Optional[Numbers] = ...,
    require: Optional[str] = ...,
    forbid: Optional[str] = ...,
    block_sizes: Union[None, str, Sequence[int]] = ...,
    constraints: Union[None, Path, Sequence[Mapping[str, Any]]] = ...,
    A_ub: Optional[ArrayLike] = ...,
    b_ub: Optional[ArrayLike] = ...,
    A_eq: Optional[ArrayLike] = ...,
    b_eq: Optional[ArrayLike] = ...,
) -> list[dict[str, Any]]: ...
def robust(
    sets: Sequence[Information],
    *,
    objective: str = ...,
    reference: str = ...,
    gap: float = ...,
    time_limit: Optional[float] = ...,
    threads: int = ...,
    psd_tolerance: float = ...,
    factors: bool = ...,
    progress: Progress = ...,
) -> RobustDesign: ...
def concentrated(
    H: Information,
    largest_share: float,
    of_candidates: float,
    *,
    gap: float = ...,
    time_limit: Optional[float] = ...,
    threads: int = ...,
    psd_tolerance: float = ...,
    factors: bool = ...,
    progress: Progress = ...,
) -> ConcentratedDesign: ...
def robot_set(
    robot: Optional[Path] = ...,
    grid: Union[int, Path, ArrayLike] = ...,
    *,
    stiffness: Optional[ArrayLike] = ...,
    threads: int = ...,
) -> InformationSet: ...
def spectrum(
    robot: Optional[Path] = ...,
    grid: Union[int, Path, ArrayLike] = ...,
    *,
    position_limit: float = ...,
    gap: float = ...,
    time_limit: Optional[float] = ...,
    seed: int = ...,
    threads: int = ...,
    progress: Progress = ...,
) -> SpectrumDesign: ...
def sequential(
    robot: Optional[Path] = ...,
    grid: Union[int, Path, ArrayLike] = ...,
    *,
    stages: int = ...,
    experiments_per_stage: int = ...,
    repetitions: int = ...,
    start_error: float = ...,
    noise: float = ...,
    seed: int = ...,
    threads: int = ...,
    progress: Progress = ...,
) -> SequentialStudy: ...
def solvers() -> list[dict[str, Any]]: ...

class Recording:
    time: NDArray[np.float64]
    def __init__(
        self,
        time: ArrayLike,
        inputs: Mapping[str, Signal],
        outputs: Mapping[str, Signal],
        others: Optional[Mapping[str, Signal]] = ...,
        *,
        role: str = ...,
        hold: Optional[str] = ...,
        noise: Optional[Mapping[str, float]] = ...,
        preprocess: Optional[Sequence[Mapping[str, Any]]] = ...,
        sample_time: Optional[float] = ...,
        name: Optional[str] = ...,
        **experiment: Any,
    ) -> None: ...

class Verdict:
    data: dict[str, Any]
    figures: dict[str, str]
    model: Optional[str]
    verdict: str
    words: list[str]
    physics: list[dict[str, Any]]
    reasons: list[dict[str, Any]]
    def __getattr__(self, name: str) -> Any: ...
    def to_json(self) -> str: ...
    def _repr_html_(self) -> str: ...

class Fit:
    data: dict[str, Any]
    parameters: list[dict[str, Any]]
    @property
    def converged(self) -> bool: ...
    @property
    def values(self) -> dict[str, float]: ...
    @property
    def standard_errors(self) -> dict[str, Optional[float]]: ...
    def __getattr__(self, name: str) -> Any: ...
    def to_json(self) -> str: ...
    def _repr_html_(self) -> str: ...

class Prediction:
    data: dict[str, Any]
    curves: list[dict[str, Any]]
    rows: list[dict[str, Any]]
    def __getattr__(self, name: str) -> Any: ...
    def to_json(self) -> str: ...
    def _repr_html_(self) -> str: ...

class Simulation:
    data: dict[str, Any]
    campaign: str
    recordings: int
    already_there: int
    complete: bool
    def __getattr__(self, name: str) -> Any: ...
    def to_json(self) -> str: ...
    def _repr_html_(self) -> str: ...

class MachineModel:
    data: dict[str, Any]
    model: str
    campaign: str
    guesses: list[dict[str, str]]
    notes: list[str]
    questions: list[str]
    def __getattr__(self, name: str) -> Any: ...
    def to_json(self) -> str: ...
    def _repr_html_(self) -> str: ...

def diagnose(
    model: Model,
    recordings: Recordings,
    *,
    report: Optional[Path] = ...,
    method: str = ...,
    without: Sequence[str] = ...,
    laws: Union[Path, Sequence[Path]] = ...,
    places: Union[Path, Sequence[Path]] = ...,
    level: float = ...,
    effects: Optional[int] = ...,
    ignore_faults: bool = ...,
    time_limit: Optional[float] = ...,
    seed: int = ...,
    threads: int = ...,
    progress: Progress = ...,
) -> Verdict: ...
def fit(
    model: Model,
    recordings: Recordings,
    *,
    write: Optional[Path] = ...,
    physics: Union[Path, Sequence[Path]] = ...,
    starts: int = ...,
    all_starts: bool = ...,
    lines: str = ...,
    refine: Sequence[str] = ...,
    decimate: int = ...,
    equal_noise: bool = ...,
    initial_state: str = ...,
    seed: int = ...,
    threads: int = ...,
    progress: Progress = ...,
) -> Fit: ...
def predict(
    model: Model,
    recordings: Recordings,
    *,
    physics: Union[Path, Sequence[Path]] = ...,
    initial_state: str = ...,
    threads: int = ...,
) -> Prediction: ...
def simulate(
    model: Model,
    plan: Model,
    folder: Path,
    *,
    hidden: Optional[Model] = ...,
    seed: int = ...,
    threads: int = ...,
    progress: Progress = ...,
) -> Simulation: ...
def model(
    *files_of_machine: Path,
    folder: Path = ...,
    columns: Sequence[str] = ...,
    sample_time: Optional[float] = ...,
    counts_per_turn: Optional[float] = ...,
    gain: Optional[float] = ...,
    base: str = ...,
    tip: str = ...,
    masses: Optional[int] = ...,
    motion: str = ...,
    overwrite: bool = ...,
) -> MachineModel: ...
