// Back to front: depths by linear blend skinning, which every choice but dual quaternions moves means by, then a counting sort.
class Order {
  constructor() {
    this.depths = new Float32Array(meta.count);
    this.keys = new Uint16Array(meta.count);
    this.order = new Uint32Array(meta.count);
    this.counts = new Uint32Array(65537);
    this.rows = new Float64Array(4 * meta.joints);
  }

  // A joint's motion, read along the direction in which the camera looks.
  useDirection(frame, [dx, dy, dz]) {
    for (let j = 0; j < meta.joints; j++) {
      const at = 8 * (frame * meta.joints + j);
      const [x, y, z, w, a, b, c] = data.motion.subarray(at, at + 7);
      this.rows[4 * j] = dx * (1 - 2 * (y * y + z * z)) + dy * 2 * (x * y + w * z) + dz * 2 * (x * z - w * y);
      this.rows[4 * j + 1] = dx * 2 * (x * y - w * z) + dy * (1 - 2 * (x * x + z * z)) + dz * 2 * (y * z + w * x);
      this.rows[4 * j + 2] = dx * 2 * (x * z + w * y) + dy * 2 * (y * z - w * x) + dz * (1 - 2 * (x * x + y * y));
      this.rows[4 * j + 3] = dx * a + dy * b + dz * c;
    }
  }

  sorted(frame, direction) {
    this.useDirection(frame, direction);
    const { rows, depths, keys, counts, order } = this;
    const { gaussians, indices, weights } = data;
    const plane = 4 * meta.width * meta.rows;
    let least = Infinity;
    let most = -Infinity;
    for (let i = 0; i < meta.count; i++) {
      const x = gaussians[4 * i];
      const y = gaussians[4 * i + 1];
      const z = gaussians[4 * i + 2];
      let depth = 0;
      for (let at = 4 * i; at < meta.influenceSets * plane; at += plane) {
        for (let k = at; k < at + 4; k++) {
          const weight = weights[k];
          if (weight > 0) {
            const r = 4 * indices[k];
            depth += weight * (rows[r] * x + rows[r + 1] * y + rows[r + 2] * z + rows[r + 3]);
          }
        }
      }
      depths[i] = depth;
      if (depth < least) least = depth;
      if (depth > most) most = depth;
    }
    const scale = 65535 / Math.max(most - least, 1e-9);
    counts.fill(0);
    for (let i = 0; i < meta.count; i++) {
      // The farthest first.
      const key = 65535 - ((depths[i] - least) * scale) | 0;
      keys[i] = key;
      counts[keys[i] + 1]++;
    }
    for (let k = 0; k < 65536; k++) counts[k + 1] += counts[k];
    for (let i = 0; i < meta.count; i++) order[counts[keys[i]]++] = i;
    return order;
  }
}
