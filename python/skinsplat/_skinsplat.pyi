from typing import Dict, List, Optional, Sequence, Tuple

import numpy as np
from numpy.typing import NDArray

__version__: str

class Avatar:
    """Canonical Gaussians, as their file has them."""

    def __init__(
        self,
        means: NDArray[np.float32],
        rotations: NDArray[np.float32],
        scales: NDArray[np.float32],
        opacities: NDArray[np.float32],
        sh: NDArray[np.float32],
        joints: Optional[NDArray[np.int64]] = None,
        weights: Optional[NDArray[np.float32]] = None,
    ) -> None: ...
    @staticmethod
    def read(path: str) -> Avatar: ...
    def write(self, path: str) -> None: ...
    def __len__(self) -> int: ...
    @property
    def format(self) -> str: ...
    @property
    def notes(self) -> List[str]: ...
    @property
    def sh_degree(self) -> int: ...
    @property
    def means(self) -> NDArray[np.float32]:
        """(n, 3), metres."""
    @property
    def rotations(self) -> NDArray[np.float32]:
        """(n, 4), unit quaternions (w, x, y, z)."""
    @property
    def scales(self) -> NDArray[np.float32]:
        """(n, 3), standard deviations, metres."""
    @property
    def opacities(self) -> NDArray[np.float32]:
        """(n), in [0, 1]."""
    @property
    def sh(self) -> NDArray[np.float32]:
        """(n, c, 3), basis and order of 3DGS."""

class Body:
    """A body of one shape at rest."""

    @staticmethod
    def read(path: str, betas: Optional[List[float]] = None, expression: Optional[List[float]] = None) -> Body: ...
    @property
    def notes(self) -> List[str]: ...
    @property
    def joint_names(self) -> List[str]: ...
    @property
    def vertices(self) -> NDArray[np.float64]:
        """(v, 3), metres."""
    @property
    def faces(self) -> NDArray[np.uint32]:
        """(f, 3)."""
    def rest_pose(self) -> Pose: ...
    def pose(self, axis_angles: NDArray[np.float64], translation: Optional[Sequence[float]] = None) -> Pose:
        """A pose of axis-angle vectors (j, 3), radians, and a translation, metres."""
    def poses(self, path: str, clip: Optional[str] = None) -> List[Pose]:
        """Every pose of a file: smplx, AMASS, AIST++, glTF clips."""

class Pose:
    """A pose of a body."""

class Camera:
    """A pinhole camera, OpenCV axes, pixel centres at +0.5."""

    def __init__(
        self,
        width: int,
        height: int,
        fx: float,
        fy: float,
        cx: float,
        cy: float,
        world_to_camera: NDArray[np.float64],
    ) -> None: ...
    @staticmethod
    def read(path: str) -> List[Camera]: ...
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...

class Posed:
    """Gaussians in world space, ready to draw."""

    @staticmethod
    def static_(avatar: Avatar) -> Posed: ...
    def __len__(self) -> int: ...
    @property
    def notes(self) -> List[str]: ...
    @property
    def means(self) -> NDArray[np.float32]:
        """(n, 3), metres."""
    @property
    def factors(self) -> NDArray[np.float32]:
        """(n, 3, 3): M with covariance M M^T."""
    @property
    def covariances(self) -> NDArray[np.float32]:
        """(n, 3, 3), square metres."""
    @property
    def rotations(self) -> Optional[NDArray[np.float32]]:
        """(n, 4), where the strategy has rotations."""
    @property
    def opacities(self) -> NDArray[np.float32]: ...
    @property
    def sh(self) -> NDArray[np.float32]:
        """(n, c, 3), turned where the strategy turns them."""
    def bake(self) -> Tuple[Avatar, Optional[str]]:
        """As a static avatar, which any viewer draws, and what that loses."""

def average(quats: NDArray[np.float64], weights: NDArray[np.float64], solver: str) -> NDArray[np.float64]: ...
def rotate_sh(sh: NDArray[np.float64], quats: NDArray[np.float64]) -> NDArray[np.float64]: ...
def pose(avatar: Avatar, body: Body, pose: Pose, strategy: str) -> Posed: ...
def render(
    posed: Posed, camera: Camera, background: Sequence[float], antialiased: bool
) -> NDArray[np.float32]: ...
def score_images(
    render: NDArray[np.float32],
    truth: NDArray[np.float32],
    protocol: str,
    mask: Optional[NDArray[np.float32]],
    metrics: List[str],
) -> Tuple[Dict[str, float], Dict[str, str]]: ...
def run_program(arguments: List[str]) -> int: ...
