// The camera of all pictures: OpenCV for the program, matrices of OpenGL for the viewers.

/** Size in pixels, focal lengths, principal point, world to camera (rows; x right, y down, z forward), background. */
export const camera = {
  width: 512,
  height: 512,
  fx: 799,
  fy: 799,
  cx: 256,
  cy: 256,
  world_to_camera: [
    [1, 0, 0, 0.033938232741343666],
    [0, -0.998903174369838, 0.04682358629858615, 0.0528257311398984],
    [0, -0.04682358629858615, -0.998903174369838, 3.19817612040326],
    [0, 0, 0, 1],
  ],
  background: [1, 1, 1],
};

/** For a viewer: column-major world to view (y up, looking along -z) and projection to clip space with z in [-1, 1]. */
export function forViewers(camera, [near, far] = [0.2, 100]) {
  const { width, height, fx, fy, cx, cy, world_to_camera: rows, background } = camera;
  const view = [rows[0], rows[1].map((v) => -v), rows[2].map((v) => -v), rows[3]];
  const projection = [
    [(2 * fx) / width, 0, 1 - (2 * cx) / width, 0],
    [0, (2 * fy) / height, (2 * cy) / height - 1, 0],
    [0, 0, -(far + near) / (far - near), (-2 * far * near) / (far - near)],
    [0, 0, -1, 0],
  ];
  const columns = (matrix) => [0, 1, 2, 3].flatMap((c) => matrix.map((row) => row[c]));
  const fov = (2 * Math.atan(height / (2 * fy)) * 180) / Math.PI;
  return { width, height, near, far, fov, background, view: columns(view), projection: columns(projection) };
}
