// Pictures as rows of RGB in floats, top row first, and how far two of them are apart.
import { readFileSync } from "node:fs";

/** An image that `reproduce render --out X.npy` wrote: f32, height x width x 3. */
export function readNpy(path) {
  const bytes = readFileSync(path);
  const start = 10 + bytes.readUInt16LE(8);
  const [height, width] = /'shape': \((\d+), *(\d+), *3,? *\)/.exec(bytes.toString("latin1", 10, start)).slice(1).map(Number);
  const values = new Float32Array(width * height * 3);
  for (let k = 0; k < values.length; k++) values[k] = bytes.readFloatLE(start + 4 * k);
  return { width, height, values };
}

/** The picture of a screen: 8 bits. */
export function rounded({ values, ...rest }) {
  return { ...rest, values: values.map((v) => Math.round(255 * Math.min(1, Math.max(0, v))) / 255) };
}

/** PSNR over all pixels and channels in dB, the largest difference and the share of pixels that differ by more than 8/255. */
export function compared(one, two) {
  if (one.width !== two.width || one.height !== two.height) throw new Error("pictures of different sizes");
  let [squares, largest, far] = [0, 0, 0];
  for (let pixel = 0; pixel < one.values.length; pixel += 3) {
    let worst = 0;
    for (let k = pixel; k < pixel + 3; k++) {
      const difference = Math.abs(one.values[k] - two.values[k]);
      squares += difference ** 2;
      worst = Math.max(worst, difference);
    }
    largest = Math.max(largest, worst);
    if (worst > 8 / 255) far++;
  }
  const psnr = -10 * Math.log10(squares / one.values.length);
  return { psnr, largest, far: far / (one.width * one.height) };
}
