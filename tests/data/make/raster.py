"""fixtures/raster: the scene and the camera, byte for byte as benches/gen_raster_scenes.py makes them.

The image and the gradients are what the original 3DGS CUDA kernels computed; they cannot be made here.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from common import FIXTURES, REPOSITORY, load

SCENE, CAMERA = "raster/scene_S.ply", "raster/front_512.json"


def recompute():
    """(the bytes of the scene, the camera with the convention)."""
    script = REPOSITORY / "benches/gen_raster_scenes.py"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run([sys.executable, script, folder, "S"], check=True, stdout=subprocess.DEVNULL)
        made = load(folder / "cameras.json")
        camera = next(camera for camera in made["cameras"] if camera["name"] == "front_512")
        return (folder / "scene_S.ply").read_bytes(), {"convention": made["convention"], **camera}


def main(arguments):
    if arguments not in ([], ["--check"]):
        print(
            "expected --check: the scene and the camera are written by benches/gen_raster_scenes.py",
            file=sys.stderr,
        )
        return 2
    scene, camera = recompute()
    same = {SCENE: (FIXTURES / SCENE).read_bytes() == scene, CAMERA: load(CAMERA) == camera}
    for path, equal in same.items():
        print(f"{path}: {'ok: equal' if equal else '1 DIFFER'}", flush=True)
    return 0 if all(same.values()) else 1


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
