// The motion of all bodies of a run, interpolated between key poses as msahl/post/view/poses.py
// describes. A pose is seven numbers: x, y, z and the Euler parameters w, x, y, z.
import { unpackIntegers, unpackNumbers } from "./packing.js";

export const WIDTH = 7;

// Returns the place of the last time that is not after t, at least 0.
export function placeOf(times, t) {
  let low = 0;
  let high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= t) low = middle;
    else high = middle - 1;
  }
  return low;
}

// Returns the place of the nearest time.
export function nearestTo(times, t) {
  const place = placeOf(times, t);
  return place + 1 < times.length && times[place + 1] - t < t - times[place] ? place + 1 : place;
}

// A motion without time: the poses of a scene.
export function restingMotion(scene) {
  const poses = Float64Array.from(scene.bodies.flatMap((body) => body.pose));
  return { bodies: scene.bodies.length, outputs: Float64Array.of(0), end: 0, at: () => poses, isStill: true };
}

// Returns the motion that a page holds: at(t) returns the poses of all bodies at a time, in an
// array that the next call overwrites.
export async function readMotion(packed) {
  const [times, values, outputs] = await Promise.all([
    unpackNumbers(packed.time),
    unpackIntegers(packed.values),
    packed.outputs && unpackNumbers(packed.outputs),
  ]);
  const width = packed.bodies * WIDTH;
  const count = Math.min(4, times.length);
  const poses = new Float64Array(width);
  const weights = new Float64Array(count);
  for (let i = 0; i < values.length; i++) {
    const part = i % WIDTH;
    values[i] = part < 3 ? packed.middle[part] + packed.lengthUnit * values[i] : packed.eulerUnit * values[i];
  }

  function at(time) {
    const t = Math.min(Math.max(time, times[0]), times[times.length - 1]);
    const first = Math.min(Math.max(placeOf(times, t) - 1, 0), times.length - count);
    for (let j = 0; j < count; j++) {
      weights[j] = 1;
      for (let k = 0; k < count; k++) {
        if (k !== j) weights[j] *= (t - times[first + k]) / (times[first + j] - times[first + k]);
      }
    }
    for (let i = 0; i < width; i++) {
      let sum = 0;
      for (let j = 0; j < count; j++) sum += weights[j] * values[(first + j) * width + i];
      poses[i] = sum;
    }
    for (let i = 3; i < width; i += WIDTH) {
      const norm = Math.hypot(poses[i], poses[i + 1], poses[i + 2], poses[i + 3]) || 1;
      for (let k = 0; k < 4; k++) poses[i + k] /= norm;
    }
    return poses;
  }

  const end = times[times.length - 1];
  return { bodies: packed.bodies, outputs: outputs ?? times, end, at, isStill: times.length < 2 };
}

// Returns the columns that a page holds: their numbers, and the value of one at a time.
export async function readColumns(packed) {
  const [times, values] = await Promise.all([
    unpackNumbers(packed.time),
    unpackIntegers(packed.values),
  ]);
  const width = packed.names.length;
  const places = new Map(packed.names.map((name, place) => [name, place]));
  const number = (row, place) => packed.least[place] + packed.step[place] * values[row * width + place];

  // The value of a column at a time, on a straight line between its rows.
  function at(place, t) {
    const row = placeOf(times, t);
    if (row + 1 >= times.length || t <= times[row]) return number(row, place);
    const part = (t - times[row]) / (times[row + 1] - times[row]);
    return (1 - part) * number(row, place) + part * number(row + 1, place);
  }

  function series(place) {
    return Array.from(times, (_, row) => number(row, place));
  }

  return { ...packed, times, places, at, series };
}
