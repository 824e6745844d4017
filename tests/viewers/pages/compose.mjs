// Pictures beside each other, with a title over each, as one file.

/**
 * `panels` are { title, data: base64 of RGB bytes } of one size, `crop` is [x, y, width, height], `zoom` a whole number. Returns a JPEG
 * in base64.
 */
export async function draw({ panels, width, crop: [left, top, w, h], zoom, quality }) {
  const [gap, head] = [8, 26];
  const canvas = document.createElement("canvas");
  canvas.width = panels.length * (w * zoom + gap) - gap;
  canvas.height = h * zoom + head;
  const context = canvas.getContext("2d");
  context.fillStyle = "white";
  context.fillRect(0, 0, canvas.width, canvas.height);
  context.imageSmoothingEnabled = false;
  for (const [k, { title, data }] of panels.entries()) {
    const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
    const image = new ImageData(w, h);
    for (let y = 0; y < h; y++) {
      for (let x = 0; x < w; x++) {
        const from = 3 * ((top + y) * width + left + x);
        image.data.set([bytes[from], bytes[from + 1], bytes[from + 2], 255], 4 * (y * w + x));
      }
    }
    const at = k * (w * zoom + gap);
    context.drawImage(await createImageBitmap(image), at, head, w * zoom, h * zoom);
    context.fillStyle = "black";
    context.font = "15px sans-serif";
    context.textAlign = "center";
    context.fillText(title, at + (w * zoom) / 2, 18, w * zoom - 4);
  }
  return canvas.toDataURL("image/jpeg", quality).split(",")[1];
}
