// Where a chain is between two of its samples.

// The last sample at or before a time; samples are in order.
function sampleBefore(t, time) {
  let low = 0;
  let high = t.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (t[middle] <= time) low = middle;
    else high = middle - 1;
  }
  return low;
}

// The places (x, y, x, y, ...) of a body at a time, m: the cubic through the four samples around it.
function placesAt(body, time, out) {
  const { t, places, points, unit } = body;
  const count = 2 * points;
  const last = t.length - 1;
  const i = sampleBefore(t, time);
  const at = (k) => Math.min(Math.max(k, 0), last) * count;
  const s = i < last ? Math.min(Math.max((time - t[i]) / (t[i + 1] - t[i]), 0), 1) : 0;
  const [a, b, c, d] = [at(i - 1), at(i), at(i + 1), at(i + 2)];
  const [wa, wb, wc, wd] = catmullRom(s);
  for (let k = 0; k < count; k += 1) {
    out[k] = unit * (wa * places[a + k] + wb * places[b + k] + wc * places[c + k] + wd * places[d + k]);
  }
  return out;
}

function catmullRom(s) {
  const [s2, s3] = [s * s, s * s * s];
  return [(-s3 + 2 * s2 - s) / 2, (3 * s3 - 5 * s2 + 2) / 2, (-3 * s3 + 4 * s2 + s) / 2, (s3 - s2) / 2];
}

// The value of a curve at a time; NaN beyond its ends.
function valueAt(curve, time) {
  const { t, values } = curve;
  if (!t.length || time < t[0] || time > t[t.length - 1] * (1 + 1e-6)) return NaN;
  return values[sampleBefore(t, time * (1 + 1e-7))];
}
