"""The native half: see src/python/lib.rs."""

from os import PathLike
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple, Union

import numpy as np
from numpy.typing import NDArray

_Progress = Optional[Callable[[str, int, int], Any]]
_Document = Tuple[str, str]

def program(arguments: Sequence[str]) -> int: ...
def run(
    arguments: Sequence[str], given: Sequence[_Document], progress: _Progress
) -> Tuple[bytes, str, bytes]: ...
def text_of(path: Union[str, PathLike[str]]) -> str: ...
def check_design(document: _Document) -> str: ...
def fields(
    document: _Document,
    points: NDArray[np.float64],
    force: bool,
    tolerance: Optional[float],
    progress: _Progress,
) -> Dict[str, Any]: ...
def tabulate(
    document: _Document, components: str, tolerance: Optional[float], progress: _Progress
) -> Dict[str, Any]: ...

class Bundle:
    def __init__(self, folder: Union[str, PathLike[str]]) -> None: ...
    def currents(
        self, points: NDArray[np.float64]
    ) -> Tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.uint8]]: ...
    def force_per_ampere(self, points: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def height(self, points: NDArray[np.float64]) -> NDArray[np.float64]: ...
