// Strips for docs/viewers: ours | viewer | difference.
import { writeFileSync } from "node:fs";

const base64 = ({ values }) => Buffer.from(Uint8Array.from(values, (v) => Math.round(255 * Math.min(1, Math.max(0, v))))).toString("base64");

/** What differs, times `factor`, on black. */
export function difference(one, two, factor) {
  return { ...one, values: one.values.map((v, k) => factor * Math.abs(v - two.values[k])) };
}

/** The part of a picture that is not background, with a margin: x, y, width, height. */
export function drawn({ width, height, values }, background, margin = 10) {
  let [left, top, right, bottom] = [width, height, 0, 0];
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      const at = 3 * (y * width + x);
      if (background.every((b, c) => Math.abs(values[at + c] - b) < 0.02)) continue;
      [left, right] = [Math.min(left, x), Math.max(right, x)];
      [top, bottom] = [Math.min(top, y), Math.max(bottom, y)];
    }
  }
  const [x, y] = [Math.max(0, left - margin), Math.max(0, top - margin)];
  return [x, y, Math.min(width, right + margin) - x, Math.min(height, bottom + margin) - y];
}

/** Writes a JPEG of at most 300 kB. `panels` are [title, picture]. */
export async function writeStrip(browser, path, panels, crop, zoom = 2) {
  const [{ width }] = panels.map(([, picture]) => picture);
  const parts = panels.map(([title, picture]) => ({ title, data: base64(picture) }));
  for (const quality of [0.9, 0.8, 0.7, 0.6]) {
    const { answer } = await browser.ask("compose", "draw", { panels: parts, width, crop, zoom, quality });
    const bytes = Buffer.from(answer, "base64");
    if (bytes.length < 300_000) return writeFileSync(path, bytes);
  }
  throw new Error(`${path}: over 300 kB`);
}
