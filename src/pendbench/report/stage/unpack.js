// Numbers from text: base64 of little-endian numbers, as packing.py writes them.
function bytesOf(text) {
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i += 1) bytes[i] = raw.charCodeAt(i);
  return bytes.buffer;
}

function unpackCurve(packed) {
  return { t: new Float32Array(bytesOf(packed.t)), values: new Float32Array(bytesOf(packed.values)) };
}

function unpackBody(packed) {
  return {
    t: new Float64Array(bytesOf(packed.t)),
    points: packed.points,
    unit: packed.reach / 32767,
    places: new Int16Array(bytesOf(packed.places)),
    colour: packed.colour,
  };
}

function unpackAct(packed) {
  return {
    ...packed,
    shown: true,
    bodies: packed.bodies.map(unpackBody),
    error: unpackCurve(packed.error),
    energy: unpackCurve(packed.energy),
  };
}

function unpackStage(packed) {
  const truth = packed.truth && {
    body: unpackBody(packed.truth.body),
    bound: unpackCurve(packed.truth.bound),
    horizon: packed.truth.horizon,
    ends: packed.truth.ends,
  };
  return { ...packed, acts: packed.acts.map(unpackAct), truth };
}
