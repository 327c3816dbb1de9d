from typing import Any, Callable, Iterable, Mapping, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import Certificate, Information

class Problem:
    packed: NDArray[np.float64]
    dimension: int
    gap: float
    time_limit: float
    seed: int
    @property
    def matrices(self) -> NDArray[np.float64]: ...

class Row:
    solver: str
    set: str
    status: str
    gap: float
    seconds: float
    certificate: Optional[Certificate]
    message: str
    def _repr_html_(self) -> str: ...

class Study:
    rows: list[Row]
    @property
    def best(self) -> list[Row]: ...
    def _repr_html_(self) -> str: ...

def run(
    solvers: Mapping[str, Callable[[Problem], ArrayLike]],
    sets: Union[Sequence[Information], Mapping[str, Information]],
    against: Iterable[str] = ...,
    *,
    gap: float = ...,
    time_limit: float = ...,
    repetitions: int = ...,
    seed: int = ...,
) -> Study: ...
