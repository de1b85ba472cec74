// Many agents as a picture of their density.

import { binned } from "./colours.js";
import { speeds } from "./frames.js";

// Each cell shines by how many agents are in it, in their mean colour.
export function density(scene, group, sx, sy, { kind, values, low, high }, width, height) {
  const cell = group.n > 50000 ? 2 : 3, w = Math.ceil(width / cell), h = Math.ceil(height / cell);
  const count = new Float32Array(w * h), red = new Float32Array(w * h), green = new Float32Array(w * h), blue = new Float32Array(w * h);
  const { bin, colours } = binned(kind, group, values ?? speeds(group), low, high, scene.dark);
  const inks = colours.map((x) => (x[0] === "#" ? [1, 3, 5].map((k) => parseInt(x.slice(k, k + 2), 16)) : x.match(/\d+/g).map(Number)));
  for (let i = 0; i < group.n; i++) {
    const x = Math.floor(sx[i] / cell), y = Math.floor(sy[i] / cell);
    if (x < 0 || y < 0 || x >= w || y >= h) continue;
    const k = y * w + x, ink = inks[bin[i]];
    count[k]++;
    red[k] += ink[0];
    green[k] += ink[1];
    blue[k] += ink[2];
  }
  scene.shade ??= document.createElement("canvas");
  [scene.shade.width, scene.shade.height] = [w, h];
  const context = scene.shade.getContext("2d"), image = context.createImageData(w, h);
  for (let k = 0; k < w * h; k++) {
    if (!count[k]) continue;
    image.data[4 * k] = red[k] / count[k];
    image.data[4 * k + 1] = green[k] / count[k];
    image.data[4 * k + 2] = blue[k] / count[k];
    image.data[4 * k + 3] = 255 * (1 - Math.exp(-0.9 * count[k]));
  }
  context.putImageData(image, 0, 0);
  scene.context.imageSmoothingEnabled = false;
  scene.context.drawImage(scene.shade, 0, 0, w * cell, h * cell);
}
