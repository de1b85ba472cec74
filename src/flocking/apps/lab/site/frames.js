// Frames from their bytes: see frame_bytes.py.

export function decoded(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let at = 4 + length;
  const take = (kind, count) => {
    const found = new kind(buffer, at, count);
    at += 4 * count;
    return found;
  };
  for (const group of head.groups) {
    group.q = take(Float32Array, group.n * group.d);
    group.p = take(Float32Array, group.n * group.d);
    group.pairs = take(Uint32Array, 2 * group.links);
    group.axes = group.directions.map(() => take(Float32Array, group.n * group.d));
    group.neighbours = group.linked ? take(Uint32Array, group.n) : null;
    group.flocks = group.flock_labels ? take(Uint32Array, group.n) : null;
    group.energy = group.energies ? take(Float32Array, group.n) : null;
    group.virtual = group.ghosts ? take(Float32Array, 3 * group.ghosts) : new Float32Array(0);
  }
  return head;
}

// A difference of coordinates to the nearest image, along an axis of a length; null where it does not repeat.
export function nearest(difference, length) {
  return length === null ? difference : difference - length * Math.round(difference / length);
}

export function speeds(group) {
  const found = new Float32Array(group.n);
  for (let i = 0; i < group.n; i++) {
    let sum = 0;
    for (let k = 0; k < group.d; k++) sum += group.p[i * group.d + k] ** 2;
    found[i] = Math.sqrt(sum);
  }
  return found;
}

// The flock of every agent: numbers of the connected components of all links, of which few may be drawn.
export function flocks(group) {
  if (group.flocks) return group.flocks;
  const parent = Uint32Array.from({ length: group.n }, (_, i) => i);
  const root = (i) => {
    while (parent[i] !== i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (let k = 0; k < group.pairs.length; k += 2) parent[root(group.pairs[k])] = root(group.pairs[k + 1]);
  const names = new Map();
  return Uint32Array.from({ length: group.n }, (_, i) => {
    const r = root(i);
    if (!names.has(r)) names.set(r, names.size);
    return names.get(r);
  });
}

// How often each distance between two agents occurs below a reach; of large groups some agents stand for all.
export function pairDistances(group, reach, bins, most = 700) {
  const counts = new Float32Array(bins), step = Math.max(1, Math.ceil(group.n / most)), { q, d } = group;
  for (let i = 0; i < group.n; i += step)
    for (let j = 0; j < i; j += step) {
      let sum = 0;
      for (let k = 0; k < d; k++) sum += nearest(q[i * d + k] - q[j * d + k], group.box[k]) ** 2;
      const bin = Math.floor((Math.sqrt(sum) / reach) * bins);
      if (bin < bins) counts[bin]++;
    }
  return counts;
}
