// Back to front by the depth of posed means, by a counting sort.
class Order {
  constructor() {
    this.depths = new Float32Array(meta.count);
    this.keys = new Uint16Array(meta.count);
    this.order = new Uint32Array(meta.count);
    this.counts = new Uint32Array(65537);
    this.rows = new Float64Array(4 * meta.joints);
    this.sum = new Float64Array(8);
    this.plane = 4 * meta.width * meta.rows;
    this.end = meta.influenceSets * this.plane;
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

  // By linear blend skinning, along x, y, z of Gaussian i.
  blendedDepth(i, x, y, z) {
    const { rows } = this;
    const { indices, weights } = data;
    let depth = 0;
    for (let at = 4 * i; at < this.end; at += this.plane) {
      for (let k = at; k < at + 4; k++) {
        const weight = weights[k];
        if (weight > 0) {
          const r = 4 * indices[k];
          depth += weight * (rows[r] * x + rows[r + 1] * y + rows[r + 2] * z + rows[r + 3]);
        }
      }
    }
    return depth;
  }

  // By dual quaternions on the side of the heaviest joint.
  dualDepth(i, x, y, z, frame, direction) {
    const { indices, weights, motion } = data;
    const first = 8 * frame * meta.joints;
    let heaviest = 0;
    let h = first;
    for (let at = 4 * i; at < this.end; at += this.plane) {
      for (let k = at; k < at + 4; k++) {
        if (weights[k] > heaviest) {
          heaviest = weights[k];
          h = first + 8 * indices[k];
        }
      }
    }
    const sum = this.sum.fill(0);
    for (let at = 4 * i; at < this.end; at += this.plane) {
      for (let k = at; k < at + 4; k++) {
        if (!(weights[k] > 0)) continue;
        const j = first + 8 * indices[k];
        const [qx, qy, qz, qw, a, b, c] = [motion[j], motion[j + 1], motion[j + 2], motion[j + 3], motion[j + 4], motion[j + 5], motion[j + 6]];
        const cosine = qx * motion[h] + qy * motion[h + 1] + qz * motion[h + 2] + qw * motion[h + 3];
        const w = cosine < 0 ? -weights[k] : weights[k];
        sum[0] += w * qx;
        sum[1] += w * qy;
        sum[2] += w * qz;
        sum[3] += w * qw;
        sum[4] += w * (a * qw + b * qz - c * qy);
        sum[5] += w * (b * qw + c * qx - a * qz);
        sum[6] += w * (c * qw + a * qy - b * qx);
        sum[7] -= w * (a * qx + b * qy + c * qz);
      }
    }
    const [rx, ry, rz, rw, dx, dy, dz, dw] = sum;
    const square = rx * rx + ry * ry + rz * rz + rw * rw;
    // R x + t, both times the square of the length.
    const [tx, ty, tz] = [2 * (ry * z - rz * y), 2 * (rz * x - rx * z), 2 * (rx * y - ry * x)];
    const moved = [
      x * square + rw * tx + ry * tz - rz * ty + (rw * dx - dw * rx - dy * rz + dz * ry),
      y * square + rw * ty + rz * tx - rx * tz + (rw * dy - dw * ry - dz * rx + dx * rz),
      z * square + rw * tz + rx * ty - ry * tx + (rw * dz - dw * rz - dx * ry + dy * rx),
    ];
    return dot(direction, moved) / square;
  }

  sorted(frame, direction, dual) {
    this.useDirection(frame, direction);
    const { depths, keys, counts, order } = this;
    const { gaussians } = data;
    let least = Infinity;
    let most = -Infinity;
    for (let i = 0; i < meta.count; i++) {
      const [x, y, z] = [gaussians[4 * i], gaussians[4 * i + 1], gaussians[4 * i + 2]];
      const depth = dual ? this.dualDepth(i, x, y, z, frame, direction) : this.blendedDepth(i, x, y, z);
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
