// An eye that circles a point.
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (v) => v.map((c) => c / Math.sqrt(dot(v, v)));
const added = (a, k, b) => a.map((c, i) => c + k * b[i]);

class Camera {
  constructor() {
    this.up = meta.up;
    // Where the eye is at first: before the avatar if it looks along +z (y up) or -y (z up).
    this.front = Math.abs(this.up[2]) > 0.5 ? [0, -1, 0] : [0, 0, this.up[1]];
    this.reset();
  }

  reset() {
    this.followed = meta.centres[0];
    this.shifted = [0, 0, 0];
    this.size = Math.max(meta.reach, 1e-3);
    this.distance = 3 * this.size;
    this.turn = 0;
    this.tilt = 0.1;
    this.update();
  }

  update() {
    this.tilt = Math.min(Math.max(this.tilt, -1.5), 1.5);
    this.distance = Math.min(Math.max(this.distance, 0.05 * this.size), 20 * this.size);
    const side = cross(this.up, this.front);
    const level = added(this.front.map((c) => c * Math.cos(this.turn)), Math.sin(this.turn), side);
    const back = added(level.map((c) => c * Math.cos(this.tilt)), Math.sin(this.tilt), this.up);
    this.eye = added(added(this.followed, 1, this.shifted), this.distance, back);
    const right = unit(cross(this.up, back));
    const above = cross(back, right);
    this.direction = back.map((c) => -c);
    this.right = right;
    this.above = above;
    const [x, y, z] = [right, above, back];
    this.matrix = new Float32Array([
      x[0], y[0], z[0], 0,
      x[1], y[1], z[1], 0,
      x[2], y[2], z[2], 0,
      -dot(x, this.eye), -dot(y, this.eye), -dot(z, this.eye), 1,
    ]);
  }

  // 45 degrees from top to bottom.
  focal(height) {
    return height / 2 / Math.tan(Math.PI / 8);
  }

  // Keeps to the middle of the avatar.
  follow(frame) {
    this.followed = meta.centres[frame];
    this.update();
  }

  orbit(dx, dy) {
    this.turn -= dx;
    this.tilt += dy;
    this.update();
  }

  shift(dx, dy, height) {
    const scale = this.distance / this.focal(height);
    this.shifted = added(added(this.shifted, -dx * scale, this.right), dy * scale, this.above);
    this.update();
  }

  zoom(factor) {
    this.distance *= factor;
    this.update();
  }
}
