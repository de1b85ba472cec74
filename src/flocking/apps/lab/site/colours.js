// Colours of agents: from slow to fast, of headings, and of flocks.

const RAMPS = {
  dark: [[125, 110, 225], [85, 150, 225], [60, 185, 175], [125, 215, 99], [253, 231, 37]],
  light: [[68, 1, 84], [59, 82, 139], [33, 145, 140], [110, 170, 50], [240, 150, 0]],
};
// Distinct for colour-blind readers (Okabe and Ito).
const FLOCKS = ["#56b4e9", "#e69f00", "#009e73", "#d55e00", "#cc79a7", "#0072b2", "#969600"];
export const BINS = 24;

export function ramp(x, dark) {
  const stops = RAMPS[dark ? "dark" : "light"];
  const at = Math.min(Math.max(Number.isFinite(x) ? x : 0.5, 0), 1) * (stops.length - 1);
  const k = Math.min(Math.floor(at), stops.length - 2), part = at - k;
  return stops[k].map((c, i) => Math.round((1 - part) * c + part * stops[k + 1][i]));
}

export const css = (c) => `rgb(${c[0]},${c[1]},${c[2]})`;
export const gradient = (dark) => `linear-gradient(90deg,${RAMPS[dark ? "dark" : "light"].map(css).join(",")})`;

// Opposite directions get opposite hues.
export function wheel(angle) {
  return [0, -2.0944, 2.0944].map((shift) => Math.round(40 + 87.5 * (1 + Math.cos(angle + shift))));
}

// The colour of each bin, and the bin of each agent.
export function binned(kind, group, values, low, high, dark) {
  const bin = new Uint8Array(group.n);
  if (kind === "heading") {
    for (let i = 0; i < group.n; i++) {
      const angle = group.d > 1 ? Math.atan2(group.p[i * group.d + 1], group.p[i * group.d]) : 0;
      bin[i] = Math.floor(((angle / (2 * Math.PI) + 1) % 1) * BINS);
    }
    return { bin, colours: Array.from({ length: BINS }, (_, k) => css(wheel(((k + 0.5) / BINS) * 2 * Math.PI))) };
  }
  if (kind === "flock") {
    for (let i = 0; i < group.n; i++) bin[i] = values[i] % FLOCKS.length;
    return { bin, colours: FLOCKS };
  }
  for (let i = 0; i < group.n; i++) {
    const x = high > low ? (values[i] - low) / (high - low) : 0.5;
    bin[i] = Math.min(BINS - 1, Math.max(0, Math.floor(x * BINS)));
  }
  return { bin, colours: Array.from({ length: BINS }, (_, k) => css(ramp((k + 0.5) / BINS, dark))) };
}
