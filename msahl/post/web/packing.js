// Arrays of numbers as msahl/post/view/packing.py packs them.
import { unpack } from "./bundles.js";

// Returns integers, row by row: differences of some order along the rows, their bytes apart.
export async function unpackIntegers({ rows, columns, order, data }) {
  const bytes = new Uint8Array(await unpack(data));
  const used = bytes[0];
  const count = rows * columns;
  const values = new Float64Array(count);
  for (let column = 0, at = 1; column < columns; column++) {
    for (let row = 0; row < rows; row++, at++) {
      let folded = 0;
      for (let plane = used - 1; plane >= 0; plane--) folded = folded * 256 + bytes[at + plane * count];
      values[row * columns + column] = folded % 2 ? -(folded + 1) / 2 : folded / 2;
    }
    for (let done = Math.min(order, rows) - 1; done >= 0; done--) {
      for (let row = done + 1; row < rows; row++) {
        values[row * columns + column] += values[(row - 1) * columns + column];
      }
    }
  }
  return values;
}

// Returns doubles.
export async function unpackNumbers(text) {
  return new Float64Array(await unpack(text));
}
