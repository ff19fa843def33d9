// The directions of the inertial axes, drawn in a corner.

const AXES = [["x", "#e03131"], ["y", "#2f9e44"], ["z", "#1c7ed6"]];

// Draws the axes as the camera's quaternion (x, y, z, w) sees them.
export function drawGizmo(canvas, { x, y, z, w }) {
  const size = 76;
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  if (canvas.width !== size * ratio) canvas.width = canvas.height = size * ratio;
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, size, size);
  // The columns of the inverse rotation are the axes in the camera's frame.
  const seen = [
    [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  ];
  const order = [0, 1, 2].sort((a, b) => seen[a][2] - seen[b][2]);
  pen.font = "600 11px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.lineWidth = 2.2;
  pen.lineCap = "round";
  for (const axis of order) {
    const [right, above, near] = seen[axis];
    const [name, colour] = AXES[axis];
    pen.globalAlpha = 0.55 + 0.45 * Math.max(0, 0.5 + near);
    pen.strokeStyle = pen.fillStyle = colour;
    pen.beginPath();
    pen.moveTo(38, 38);
    pen.lineTo(38 + 23 * right, 38 - 23 * above);
    pen.stroke();
    pen.fillText(name, 38 + 31 * right, 38 - 31 * above);
  }
  pen.globalAlpha = 1;
}
