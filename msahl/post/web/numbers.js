// How numbers of graphs are written.

// Returns a number with as many digits as a graph can show.
export function shortNumber(value) {
  if (value == null) return "-";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e6)) return value.toExponential(3).replace(/\.?0+e/, "e");
  return String(Number(value.toPrecision(5)));
}

// Returns the texts of the ticks of an axis, as uPlot asks for them.
export function tickTexts(plot, splits) {
  return splits.map((value) => (value == null ? "" : shortNumber(value)));
}
