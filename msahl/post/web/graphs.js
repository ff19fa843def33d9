// Small graphs that share cursor and zoom, drawn by uPlot.
import { loadBundle, readJson } from "./bundles.js";
import { drawMarks } from "./marks.js";
import { shortNumber, tickTexts } from "./numbers.js";
import { colourOf } from "./page.js";

const DASHES = [[], [7, 4], [2, 3], [8, 3, 2, 3]];
const GRAPH_COLOURS = 7;
const GRAPH_HEIGHT = 172;
const PRINTED_WIDTH = 330;
// A curve that varies less than this part of its size is drawn as constant.
const LEAST_VARIATION = 1e-6;
// By place in the page: the data of the graph, and uPlot's object once it is drawn.
const graphsDrawn = new Map();

function floatsOf(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return Array.from(new Float32Array(bytes.buffer), (value) => (Number.isNaN(value) ? null : value));
}

function rangeOf(largest) {
  return (plot, low, high) => {
    if (low == null) return [-1, 1];
    const middle = (low + high) / 2;
    const least = Math.max(LEAST_VARIATION * largest, 1e-300);
    // One decade below and above the size of a constant shows that it is one.
    if (high - low < least) return largest === 0 ? [-1, 1] : [middle - 0.1 * largest, middle + 0.1 * largest];
    const margin = 0.06 * (high - low);
    return [low - margin, high + margin];
  };
}

// Returns the powers of ten that a logarithmic axis names: at most six.
function powersOf(low, high) {
  const first = Math.ceil(Math.log10(low) - 1e-9);
  const last = Math.floor(Math.log10(high) + 1e-9);
  const stride = Math.max(1, Math.ceil((last - first + 1) / 6));
  const powers = [];
  for (let power = last; power >= first; power -= stride) powers.unshift(Number(`1e${power}`));
  return powers;
}

const LOGARITHMIC = {
  splits: (plot, axis, low, high) => powersOf(low, high),
  filter: (plot, splits) => splits,
  values: (plot, splits) => splits.map((value) => value.toExponential(0).replace("e+", "e")),
};

function axisOf(label, more) {
  return {
    stroke: () => colourOf("muted"),
    grid: { stroke: () => colourOf("grid"), width: 1 },
    ticks: { stroke: () => colourOf("grid"), width: 1, size: 4 },
    font: "11px system-ui, sans-serif",
    label,
    labelFont: "11px system-ui, sans-serif",
    labelSize: label ? 15 : 0,
    labelGap: 0,
    gap: 3,
    values: tickTexts,
    ...more,
  };
}

function seriesOf(curve, index, marked) {
  return {
    label: curve.name,
    stroke: () => colourOf(`series-${(index % GRAPH_COLOURS) + 1}`),
    width: 1.4,
    dash: DASHES[Math.floor(index / GRAPH_COLOURS) % DASHES.length],
    points: { show: marked },
  };
}

// Zooms all graphs of time together.
let zoomingAll = false;
function zoomAll(plot, key) {
  for (const held of graphsDrawn.values()) if (held.plot === plot) markTime(held);
  if (key !== "x" || zoomingAll || plot.status === 0) return;
  const { min, max } = plot.scales.x;
  zoomingAll = true;
  for (const { plot: other } of graphsDrawn.values()) {
    if (other && other !== plot && other.xTitle === plot.xTitle) other.setScale("x", { min, max });
  }
  zoomingAll = false;
}

// Shows the values at the cursor in the graph under the pointer.
function readOut(plot, place) {
  const box = place.querySelector(".readout");
  const index = plot.cursor.idx;
  box.hidden = index == null || !plot.over.matches(":hover");
  if (box.hidden) return;
  const name = plot.xTitle.replace(/ \[.*/, "");
  const lines = [`${name} ${shortNumber(plot.data[0][index])}`];
  for (let i = 1; i < plot.series.length; i++) {
    if (plot.series[i].show) lines.push(`${plot.series[i].label}  ${shortNumber(plot.data[i][index])}`);
  }
  box.replaceChildren(
    ...lines.map((text) => {
      const line = document.createElement("div");
      line.textContent = text;
      return line;
    }),
  );
  const right = plot.cursor.left < plot.over.clientWidth / 2;
  box.style.left = right ? "auto" : `${plot.over.offsetLeft + 4}px`;
  box.style.right = right ? "4px" : "auto";
}

function labelWidth(plot, values) {
  const longest = Math.max(0, ...(values ?? []).map((text) => text.length));
  return Math.max(34, 12 + 6.4 * longest);
}

function drawGraph(place, width) {
  const held = graphsDrawn.get(place);
  const { record, data, hiddenCurves } = held;
  held.plot?.destroy();
  const largest = Math.max(0, ...data.slice(1).flatMap((values) => values.map((v) => Math.abs(v ?? 0))));
  const marked = data[0].length < 2;
  const options = {
    width,
    height: GRAPH_HEIGHT,
    legend: { show: false },
    cursor: {
      sync: { key: `over ${record.xTitle}`, scales: ["x", null] },
      drag: { x: true, y: false },
      points: { size: 5 },
    },
    scales: {
      x: { time: false },
      y: record.log ? { distr: 3 } : { range: rangeOf(largest) },
    },
    axes: [axisOf(record.xTitle, { size: 24 }), axisOf(undefined, { size: labelWidth, ...(record.log ? LOGARITHMIC : {}) })],
    series: [{}, ...record.curves.map((curve, i) => seriesOf(curve, i, marked))],
    hooks: {
      setScale: [zoomAll],
      setCursor: [(plot) => readOut(plot, place)],
      draw: [drawMarks(record.marks ?? [])],
    },
  };
  place.replaceChildren();
  const plot = new uPlot(options, data, place);
  plot.xTitle = record.xTitle;
  for (const index of hiddenCurves) plot.setSeries(index + 1, { show: false });
  held.plot = plot;
  const box = document.createElement("div");
  box.className = "readout";
  box.hidden = true;
  place.append(box);
  held.mark = document.createElement("div");
  held.mark.className = "time-mark";
  held.mark.hidden = true;
  plot.over.append(held.mark);
  if (isOverTime(plot)) {
    plot.over.addEventListener("click", () => {
      const time = plot.posToVal(plot.cursor.left, "x");
      document.dispatchEvent(new CustomEvent("msahl-seek", { detail: time }));
    });
  }
  markTime(held);
}

function isOverTime(plot) {
  return plot.xTitle === "time [s]";
}

// The time of the viewer in the same page; null before it has told one.
let viewedTime = null;
function markTime({ plot, mark }) {
  if (!plot || !isOverTime(plot) || viewedTime === null) return;
  const { min, max } = plot.scales.x;
  mark.hidden = viewedTime < min || viewedTime > max;
  mark.style.transform = `translateX(${plot.valToPos(viewedTime, "x")}px)`;
}

function drawAllGraphs(width) {
  for (const place of graphsDrawn.keys()) {
    const wide = width ?? place.clientWidth;
    if (wide > 0) drawGraph(place, wide);
  }
}

// A legend hides and shows a curve in all graphs below it.
function toggleCurve(button) {
  const shown = button.getAttribute("aria-pressed") !== "true";
  button.setAttribute("aria-pressed", String(shown));
  const index = Number(button.dataset.curve);
  for (const place of button.closest(".graph, .graph-group").querySelectorAll(".plot")) {
    const held = graphsDrawn.get(place);
    if (shown) held.hiddenCurves.delete(index);
    else held.hiddenCurves.add(index);
    held.plot?.setSeries(index + 1, { show: shown });
  }
}

async function startGraphs() {
  await loadBundle("uplot");
  const read = {};
  // A graph is drawn when it first has a width: those in a fold have none before it is opened.
  const sizes = new ResizeObserver((entries) => {
    for (const { target, contentRect } of entries) {
      const held = graphsDrawn.get(target);
      if (contentRect.width === 0) continue;
      if (held.plot) held.plot.setSize({ width: contentRect.width, height: GRAPH_HEIGHT });
      else drawGraph(target, contentRect.width);
    }
  });
  for (const place of document.querySelectorAll(".plot")) {
    const { graphs, graph } = place.dataset;
    read[graphs] ??= readJson(graphs);
    const record = read[graphs][graph];
    const data = [floatsOf(record.x), ...record.curves.map((curve) => floatsOf(curve.values))];
    graphsDrawn.set(place, { record, data, hiddenCurves: new Set(), plot: null, mark: null });
    sizes.observe(place);
  }
  for (const button of document.querySelectorAll(".legend button")) {
    button.addEventListener("click", () => toggleCurve(button));
  }
  document.addEventListener("msahl-theme", () => drawAllGraphs());
  document.addEventListener("msahl-time", (event) => {
    viewedTime = event.detail;
    for (const held of graphsDrawn.values()) markTime(held);
  });
  addEventListener("beforeprint", () => drawAllGraphs(PRINTED_WIDTH));
  addEventListener("afterprint", () => drawAllGraphs());
}

startGraphs();
