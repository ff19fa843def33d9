// Playback of one or two runs in three dimensions. Each element with data-viewer="KEY" becomes a
// viewer of the data under that key, see msahl/post/view/page.py.
import { loadBundle, readJson } from "./bundles.js";
import { isDark } from "./page.js";
import { Arrows } from "./arrows.js";
import { buildBar, buildHelp, buildTop } from "./bars.js";
import { download, make } from "./dom.js";
import { Contacts, CONTACT_STATES } from "./contacts.js";
import { drawGizmo } from "./gizmo.js";
import { Labels, pick } from "./labels.js";
import { listenToKeys } from "./keys.js";
import { Model3d } from "./model3d.js";
import { buildModes, readModes } from "./modes.js";
import { readColumns, readMotion, restingMotion } from "./motion.js";
import { Player } from "./player.js";
import { canFilm, filmOf, pictureOf } from "./record.js";
import { Stage } from "./stage.js";
import { TimeGraph } from "./timegraph.js";
import { Traces } from "./traces.js";
import { buildTree } from "./tree.js";

const OVERLAY = { opacity: 0.42, tint: "#e8467c" };
const SLOW = 45; // milliseconds of a frame above which shadows are left out

export class Viewer {
  constructor(element, data, runs) {
    Object.assign(this, { element, data, updates: [], followed: null });
    this.canvas = make("canvas", { "aria-label": "The mechanism in three dimensions" });
    this.overlay = make("div", { class: "overlay" });
    this.gizmo = make("canvas", { class: "gizmo", "aria-hidden": true });
    this.view3d = make("div", { class: "view3d" }, this.canvas, this.overlay, this.gizmo);
    this.models = runs.map((run, index) => new Model3d(run.scene, run.motion, index ? OVERLAY : { opacity: 1 }));
    this.runs = runs;
    const box = this.models.reduce((all, model) => all.union(model.box), this.models[0].box.clone());
    this.stage = new Stage(this.canvas, box, runs[0].scene);
    for (const model of this.models) this.stage.scene.add(model.root);
    this.arrows = this.models.map((model, index) => new Arrows(model, runs[index].columns));
    Arrows.share(this.arrows);
    this.contacts = this.models.map((model, index) => new Contacts(model, runs[index].happenings));
    this.traces = this.models.map((model) => new Traces(model));
    this.labels = new Labels(this.overlay, this.models[0]);
    this.player = new Player(Math.max(...runs.map((run) => run.motion.end)), runs[0].motion.outputs, () => this.invalidate());
    this.build();
  }

  build() {
    this.tree = buildTree(this);
    this.top = buildTop(this);
    this.bar = this.player.end > 0 ? buildBar(this) : null;
    this.help = buildHelp(this);
    this.modesBar = this.hasModes ? buildModes(this) : null;
    this.graphPanel = this.hasGraph ? make("div", { class: "graph-panel" }) : null;
    const middle = make("div", { class: "middle" }, this.tree, this.view3d);
    this.element.replaceChildren(...[this.top, this.modesBar, middle, this.graphPanel, this.bar, this.help].filter(Boolean));
    if (this.graphPanel) {
      this.graph = new TimeGraph(this.graphPanel, this.runs, (time) => this.player.scrub(time));
      this.graph.choose(this.data.graph ?? []);
    }
    this.setPanel("tree", this.data.isPage && this.element.clientWidth > 900);
    this.setPanel("graph", this.data.isPage && this.element.clientWidth > 700 && this.element.clientHeight > 560);
    this.help.hidden = true;
    if (this.contacts.some(({ contacts }) => contacts.length)) this.view3d.append(this.contactLegend());
    if (this.models[0].hasHidden) this.setSeeThrough(true);
    this.listen();
    this.setTheme();
    this.resize();
    this.stage.view("home");
    if (this.hasModes && !matchMedia("(prefers-reduced-motion: reduce)").matches) this.player.play();
  }

  listen() {
    new ResizeObserver(() => this.resize()).observe(this.view3d);
    this.stage.controls.addEventListener("change", () => this.invalidate());
    this.stage.controls.addEventListener("start", () => (this.stage.isFitted = null));
    document.addEventListener("msahl-theme", () => this.setTheme());
    // Graphs beside the viewer show its time, and choose it.
    this.onUpdate(() => document.dispatchEvent(new CustomEvent("msahl-time", { detail: this.player.time })));
    document.addEventListener("msahl-seek", (event) => this.player.scrub(event.detail));
    this.canvas.addEventListener("pointermove", (event) => this.hover(event));
    this.canvas.addEventListener("click", (event) => this.click(event));
    this.canvas.addEventListener("pointerdown", (event) => (this.pressedAt = [event.clientX, event.clientY]));
    // Another part of the page may select an element: { kind, name }, or null.
    this.element.addEventListener("msahl-select", ({ detail }) => this.select(detail, false));
    this.canvas.addEventListener("pointerleave", () => this.labels.tipAt(null));
    this.canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    this.canvas.addEventListener("webglcontextrestored", () => this.invalidate());
    // After a click the keys belong to the viewer again, so Space plays instead of clicking anew.
    this.element.addEventListener("click", (event) => {
      if (event.detail > 0 && event.target.closest("button")) this.element.focus({ preventScroll: true });
    });
    listenToKeys(this);
    if (this.data.isPage) return;
    // In a report the wheel moves the page, until the viewer has been clicked.
    const zoom = () => (this.stage.controls.enableZoom = this.element.contains(document.activeElement));
    this.canvas.addEventListener("pointerdown", () => this.element.focus({ preventScroll: true }));
    this.element.addEventListener("focusin", zoom);
    this.element.addEventListener("focusout", () => setTimeout(zoom));
    zoom();
  }

  // Functions that bring a control up to date after a change.
  onUpdate(update) {
    this.updates.push(update);
  }

  invalidate() {
    if (this.isWaiting || this.isFilming) return;
    this.isWaiting = true;
    requestAnimationFrame((now) => {
      this.isWaiting = false;
      this.player.tick(now);
      this.draw();
      if (this.player.isPlaying) this.watchSpeed(now);
    });
  }

  // Draws everything at the player's time.
  draw() {
    const { time } = this.player;
    const before = this.followed === null ? null : this.centreOf(this.followed);
    for (const part of [...this.models, ...this.arrows, ...this.contacts, ...this.traces]) part.show(time);
    if (before) this.stage.shift(this.centreOf(this.followed).sub(before));
    for (const model of this.models) model.showDots(this.stage.camera);
    this.stage.render();
    this.labels.show(this.stage.camera, this.view3d.clientWidth, this.view3d.clientHeight);
    drawGizmo(this.gizmo, this.stage.camera.quaternion);
    this.graph?.show(time);
    for (const update of this.updates) update();
  }

  centreOf(body) {
    const model = this.models[0];
    return model.pointOf(body, model.scene.bodies[body].centre);
  }

  // Without a graphics card shadows cost more than they show.
  watchSpeed(now) {
    const passed = now - (this.lastFrame ?? now);
    this.lastFrame = now;
    if (passed > 500) return; // the page was not shown
    this.pace = 0.9 * (this.pace ?? passed) + 0.1 * passed;
    this.frames = (this.frames ?? 0) + 1;
    if (this.frames > 20 && this.pace > SLOW && this.stage.key.castShadow) this.stage.key.castShadow = false;
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.view3d;
    if (!width || !height) return;
    this.stage.resize(width, height);
    if (this.stage.isFitted) this.stage.fit(this.stage.isFitted);
    if (!this.isFilming) this.draw();
  }

  // What is under the pointer, and where that is in the view.
  under(event) {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - left, event.clientY - top];
    const found = pick(this.models[0], this.stage.camera, (2 * x) / width - 1, 1 - (2 * y) / height);
    return { found, x, y };
  }

  hover(event) {
    if (event.buttons) return this.labels.tipAt(null);
    const { found, x, y } = this.under(event);
    this.labels.tipAt(found, x, y);
  }

  // Selects what is under the pointer, unless the pointer was moved to turn the view.
  click(event) {
    const [x, y] = this.pressedAt ?? [event.clientX, event.clientY];
    if (Math.hypot(event.clientX - x, event.clientY - y) < 4) this.select(this.under(event).found);
  }

  isSelected(kind, name) {
    return this.selected?.kind === kind && this.selected.name === name;
  }

  // Selects an element, { kind, name }, or none; tells the page unless the page has asked for it.
  select(found, isTold = true) {
    this.selected = found && { kind: found.kind, name: found.name };
    this.models[0].highlight(this.selected);
    this.invalidate();
    if (isTold) this.element.dispatchEvent(new CustomEvent("msahl-selected", { detail: this.selected }));
  }

  setTheme() {
    this.stage.setTheme(isDark() ? "dark" : "light");
    this.graph?.draw();
    this.invalidate();
  }

  get hasModes() {
    return Boolean(this.runs[0].motion.modes);
  }

  // Brings what was computed of the motion up to date after it has changed.
  changeMotion() {
    this.models[0].scene.bodies.forEach((_, body) => {
      if (!this.hasTrace(body)) return;
      this.setTrace(body, false);
      this.setTrace(body, true);
    });
    this.invalidate();
  }

  get hasGraph() {
    return Boolean(this.runs[0].columns?.names.length) && this.player.end > 0;
  }

  get hasArrows() {
    return this.arrows.some((arrows) => !arrows.isEmpty);
  }

  get hasContacts() {
    return this.contacts.some((contacts) => !contacts.isEmpty);
  }

  // The colours of contacts, of those states that occur.
  contactLegend() {
    const states = new Set(this.contacts.flatMap((contacts) => [...contacts.states]));
    const legend = make("div", { class: "contact-legend" });
    CONTACT_STATES.forEach(([name, colour], state) => {
      if (!states.has(state)) return;
      const dot = make("i");
      dot.style.background = colour;
      legend.append(make("span", {}, dot, name));
    });
    this.onUpdate(() => (legend.hidden = !this.isOn("contacts")));
    return legend;
  }

  // Names of what can be switched, with its text and key.
  switches() {
    const scene = this.models[0].scene;
    return [
      ["names", "Names", "N"],
      ["axes", "Axes", "A"],
      this.player.end > 0 ? ["traces", "Paths", "T"] : null,
      this.hasArrows ? ["arrows", "Forces", "R"] : null,
      this.hasContacts ? ["contacts", "Contacts", "C"] : null,
      scene.joints.length ? ["joints", "Joints", "J"] : null,
      scene.springs.length ? ["springs", "Springs", "S"] : null,
      ["through", "See through", "X"],
      ["floor", "Grid", "D"],
    ].filter(Boolean);
  }

  isOn(key) {
    const model = this.models[0];
    switch (key) {
      case "names":
        return this.labels.isShown;
      case "axes":
        return Boolean(this.hasAxes);
      case "traces":
        return model.scene.bodies.some((_, body) => this.hasTrace(body));
      case "arrows":
        return this.arrows[0].root.visible;
      case "contacts":
        return this.contacts[0].root.visible;
      case "through":
        return Boolean(this.isSeeThrough);
      case "floor":
        return this.stage.floor.visible;
      default:
        return model.parts[key].visible;
    }
  }

  toggle(key) {
    if (!this.switches().some(([known]) => known === key)) return;
    const isOn = !this.isOn(key);
    if (key === "names") this.labels.isShown = isOn;
    else if (key === "axes") this.setAxes(isOn);
    else if (key === "traces") this.models[0].scene.bodies.forEach((of, body) => this.hasPath(of, body) && this.setTrace(body, isOn));
    else if (key === "arrows") for (const arrows of this.arrows) arrows.root.visible = isOn;
    else if (key === "contacts") for (const contacts of this.contacts) contacts.root.visible = isOn;
    else if (key === "through") this.setSeeThrough(isOn);
    else if (key === "floor") this.stage.floor.visible = isOn;
    else for (const model of this.models) model.parts[key].visible = isOn;
    this.invalidate();
  }

  setSeeThrough(isOn) {
    this.isSeeThrough = isOn;
    for (const model of this.models) model.setSeeThrough(isOn);
  }

  setAxes(isOn) {
    this.hasAxes = isOn;
    for (const model of this.models) {
      for (const body of model.bodies) body.children.forEach((child) => child.userData.isFrame && (child.visible = isOn));
    }
  }

  // Whether a body's path is among those that are shown together: of a beam that of its last node.
  hasPath(of, body) {
    if (of.hidden) return false;
    return of.beam === null || body === this.models[0].scene.beams[of.beam].nodes.at(-1);
  }

  hasTrace(body) {
    return this.traces[0].has(body);
  }

  setTrace(body, isShown) {
    for (const traces of this.traces) if (body < traces.model.bodies.length) traces.set(body, isShown);
    this.invalidate();
  }

  setBody(body, isVisible) {
    for (const model of this.models) if (model.bodies[body]) model.bodies[body].visible = isVisible;
    this.invalidate();
  }

  // Colours the beams of all runs by a resultant, in the range of the first; returns that.
  colourBeams(resultant) {
    const [range] = this.models.map((model) => model.colourBeams(resultant));
    for (const model of this.models) for (const beam of model.beams) beam.setResultant(resultant, range);
    this.invalidate();
    return range;
  }

  // Draws the deformation of reduced elastic bodies larger than it is.
  deform(scale) {
    for (const model of this.models) model.deform(scale);
    this.invalidate();
  }

  setArrowScale(scale) {
    for (const arrows of this.arrows) arrows.scale = scale;
    this.invalidate();
  }

  follow(body) {
    this.followed = body;
    if (body !== null) {
      this.stage.isFitted = null;
      this.stage.shift(this.centreOf(body).sub(this.stage.controls.target));
    }
    this.invalidate();
  }

  setView(name) {
    this.followed = null;
    this.stage.view(name);
    this.invalidate();
  }

  setPanel(name, isShown = !this.hasPanel(name)) {
    this.element.classList.toggle(`with-${name}`, isShown);
    for (const update of this.updates) update();
  }

  hasPanel(name) {
    return this.element.classList.contains(`with-${name}`);
  }

  async savePicture() {
    const picture = await pictureOf(this.canvas, () => this.draw());
    download(picture, `${this.fileName()}_${this.player.time.toFixed(3)}s.png`);
  }

  get canFilm() {
    return this.player.end > 0 && canFilm(this.canvas);
  }

  // Starts a film at the time shown, or ends the one that is being made.
  async saveFilm() {
    if (this.isFilming) {
      this.isFilming = false;
      return;
    }
    const from = this.player.time < this.player.end ? this.player.time : 0;
    this.player.play(false);
    this.isFilming = true;
    const film = await filmOf(this.canvas, {
      from,
      to: this.player.end,
      speed: this.player.speed,
      drawAt: (time) => {
        this.player.time = time;
        this.draw();
      },
      goesOn: () => this.isFilming,
    });
    this.isFilming = false;
    this.invalidate();
    download(film, `${this.fileName()}.webm`);
  }

  fileName() {
    return (this.runs[0].scene.title || "msahl").replace(/[^\w-]+/g, "_").slice(0, 60);
  }
}

function motionOf(run) {
  if (run.modes) return readModes(run.modes, run.scene);
  return run.motion ? readMotion(run.motion) : restingMotion(run.scene);
}

async function startViewer(element) {
  const data = readJson(element.dataset.viewer);
  await loadBundle("three");
  if (data.runs.some((run) => run.columns)) await loadBundle("uplot");
  const runs = await Promise.all(
    data.runs.map(async (run) => ({
      ...run,
      motion: await motionOf(run),
      columns: run.columns ? await readColumns(run.columns) : null,
    })),
  );
  return new Viewer(element, data, runs);
}

// What tests and other scripts may look at: nothing of it changes the viewer.
function probe(viewer) {
  return Object.freeze({
    get time() {
      return viewer.player.time;
    },
    get end() {
      return viewer.player.end;
    },
    get isPlaying() {
      return viewer.player.isPlaying;
    },
    get speed() {
      return viewer.player.speed;
    },
    get runs() {
      return viewer.runs.length;
    },
    // Number of the mode that is shown, from 0; undefined without modes.
    get mode() {
      return viewer.runs[0].motion.chosen;
    },
    get steps() {
      return Array.from(viewer.player.steps);
    },
    // Poses [x, y, z, w, x, y, z] of all bodies of a run as they are drawn.
    poses: (run = 0) =>
      viewer.models[run].bodies.map(({ position: p, quaternion: q }) => [p.x, p.y, p.z, q.w, q.x, q.y, q.z]),
    // Points of the skin of an elastic body as it is drawn, in its frame.
    skin: (number = 0, run = 0) => Array.from(viewer.models[run].elastic[number].object.geometry.attributes.position.array),
  });
}

const FAILED = "The three-dimensional view needs WebGL 2 and DecompressionStream, which this browser does not offer or has switched off. A current version of Firefox, Chrome, Edge or Safari has both.";

for (const element of document.querySelectorAll("[data-viewer]")) {
  startViewer(element).then(
    (viewer) => {
      window.msahl ??= probe(viewer);
      element.dataset.state = "ready";
      element.dispatchEvent(new CustomEvent("msahl-ready", { detail: viewer }));
    },
    (error) => {
      console.warn(error);
      element.dataset.state = "failed";
      element.replaceChildren(make("p", { class: "viewer-failed", text: FAILED }), make("p", { class: "viewer-failed", text: String(error?.message ?? error) }));
    },
  );
}
