// Lines at the times of events in a graph of uPlot.
import { colourOf } from "./page.js";

// Returns a hook that draws vertical lines at `marks`, [{ time, name }]: those of events of the deck
// with their names, as far as there is room.
export function drawMarks(marks) {
  return (plot) => {
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.lineWidth = devicePixelRatio;
    ctx.font = `${10 * devicePixelRatio}px system-ui, sans-serif`;
    ctx.textAlign = "left";
    let free = -Infinity;
    for (const { time, name } of marks) {
      const x = plot.valToPos(time, "x", true);
      ctx.strokeStyle = ctx.fillStyle = colourOf(name ? "series-2" : "muted");
      ctx.globalAlpha = name ? 0.7 : 0.4;
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      if (!name || x < free) continue;
      ctx.globalAlpha = 1;
      ctx.fillText(name, x + 3 * devicePixelRatio, bbox.top + 10 * devicePixelRatio);
      free = x + ctx.measureText(name).width + 8 * devicePixelRatio;
    }
    ctx.restore();
  };
}
