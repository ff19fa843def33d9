/* global uPlot */
// A graph of columns over the time, with a cursor that moves with the time and moves it.
import { colourOf } from "./page.js";
import { make } from "./dom.js";
import { drawMarks } from "./marks.js";
import { tickTexts } from "./numbers.js";

const MOST = 7; // columns at once: the page has as many colours

export class TimeGraph {
  // `runs` are [{ name, columns }]; `seek` is called with a time.
  constructor(holder, runs, seek) {
    Object.assign(this, { holder, runs, seek, chosen: [] });
    this.cursor = make("div", { class: "graph-cursor" });
    this.values = make("div", { class: "graph-values" });
    this.area = make("div", { class: "graph-area" });
    this.menu = this.buildMenu();
    holder.append(make("div", { class: "graph-head" }, this.menu, this.values), this.area);
    new ResizeObserver(() => this.fitSize()).observe(this.area);
  }

  get names() {
    return this.runs[0].columns.names;
  }

  // The list of all columns, by the element that they belong to.
  buildMenu() {
    const menu = make("select", { "aria-label": "Add a column to the graph", title: "Add a column to the graph" });
    menu.append(make("option", { value: "", text: "Add column" }));
    const groups = new Map();
    this.names.forEach((name, place) => {
      const element = name.includes(".") ? name.slice(0, name.lastIndexOf(".")) : this.runs[0].columns.tables[place];
      if (!groups.has(element)) {
        groups.set(element, make("optgroup", { label: element }));
        menu.append(groups.get(element));
      }
      groups.get(element).append(make("option", { value: name, text: name }));
    });
    menu.addEventListener("change", () => {
      if (menu.value) this.toggle(menu.value);
      menu.value = "";
      menu.blur();
    });
    return menu;
  }

  toggle(name) {
    const place = this.chosen.indexOf(name);
    if (place >= 0) this.chosen.splice(place, 1);
    else if (this.chosen.length < MOST) this.chosen.push(name);
    this.draw();
  }

  choose(names) {
    this.chosen = names.filter((name) => this.names.includes(name)).slice(0, MOST);
    this.draw();
  }

  // Builds the graph anew: after a choice, or for other colours.
  draw() {
    this.plot?.destroy();
    this.plot = null;
    this.values.replaceChildren();
    if (!this.chosen.length || !this.area.clientWidth) return;
    const { series, axes, scales } = this.describe();
    const options = {
      width: this.area.clientWidth,
      height: this.area.clientHeight,
      series: [{}, ...series.map((one) => one.options)],
      axes,
      scales,
      legend: { show: false },
      cursor: { show: false },
      hooks: { draw: [drawMarks(this.runs[0].happenings?.marks ?? [])] },
      padding: [8, 24, 0, 0],
    };
    this.plot = new uPlot(options, this.joined(series), this.area);
    this.plot.over.append(this.cursor);
    this.plot.over.style.cursor = "ew-resize";
    this.listen(this.plot.over);
    this.labels = series.filter((one) => one.run === 0).map((one) => this.label(one));
    this.show(this.time ?? 0);
  }

  // Series, axes and scales: one scale for each unit, the first two with an axis.
  describe() {
    const ink = colourOf("muted");
    const grid = { stroke: colourOf("grid"), width: 1 };
    const font = "12px system-ui, sans-serif";
    const axes = [{ stroke: ink, grid, ticks: grid, font, size: 30, values: tickTexts }];
    const scales = { x: { time: false, range: (_, low, high) => [low, high] } };
    const series = [];
    this.chosen.forEach((name, index) => {
      const place = this.runs[0].columns.places.get(name);
      const unit = this.runs[0].columns.units[place] || "value";
      if (!scales[unit]) {
        scales[unit] = {};
        const side = axes.length === 1 ? 3 : 1;
        if (axes.length < 3) {
          const label = unit === "value" ? undefined : unit;
          axes.push({ scale: unit, side, stroke: ink, font, label, labelFont: font, labelSize: 18, size: 60, ticks: grid, values: tickTexts, grid: side === 3 ? grid : { show: false } });
        }
      }
      const stroke = colourOf(`series-${index + 1}`);
      this.runs.forEach((run, number) => {
        const at = run.columns?.places.get(name);
        if (at === undefined) return;
        const dash = number ? [6, 4] : undefined;
        // Few values of a long run are joined by curves that keep their extremes.
        const paths = run.columns.every ? undefined : uPlot.paths.spline();
        const options = { scale: unit, stroke, width: 1.6, dash, paths, pxAlign: 0, points: { show: false }, spanGaps: true };
        series.push({ run: number, place: at, name, unit, stroke, options });
      });
    });
    return { series, axes, scales };
  }

  // The data of all series at common times.
  joined(series) {
    const tables = series.map(({ run, place }) => {
      const { columns } = this.runs[run];
      return [Array.from(columns.times), columns.series(place)];
    });
    return this.runs.length > 1 ? uPlot.join(tables) : [tables[0][0], ...tables.map((table) => table[1])];
  }

  label({ place, name, unit, stroke }) {
    const value = make("b");
    const swatch = make("i");
    swatch.style.background = stroke;
    const remove = () => this.toggle(name);
    this.values.append(make("button", { type: "button", title: `Remove ${name}`, onclick: remove }, swatch, make("span", { text: name }), value, make("small", { text: unit === "value" ? "" : unit })));
    return { place, value };
  }

  listen(over) {
    const move = (event) => {
      if (!(event.buttons & 1)) return;
      const left = event.clientX - over.getBoundingClientRect().left;
      this.seek(this.plot.posToVal(left, "x"));
      event.preventDefault();
    };
    over.addEventListener("pointerdown", (event) => {
      over.setPointerCapture(event.pointerId);
      move(event);
    });
    over.addEventListener("pointermove", move);
  }

  // Moves the cursor to a time.
  show(time) {
    this.time = time;
    if (!this.plot) return;
    this.cursor.style.transform = `translateX(${this.plot.valToPos(time, "x")}px)`;
    for (const { place, value } of this.labels) value.textContent = this.runs[0].columns.at(place, time).toPrecision(4);
  }

  fitSize() {
    const { clientWidth: width, clientHeight: height } = this.area;
    if (!width || !height) return;
    if (!this.plot) return this.draw();
    if (this.plot.width !== width || this.plot.height !== height) {
      this.plot.setSize({ width, height });
      this.show(this.time ?? 0);
    }
  }
}
