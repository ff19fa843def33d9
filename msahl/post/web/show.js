// A deck beside its model: text, faults and facts on the left, the viewer on the right. What is
// selected is marked in the text, in the list of elements and in the view. The data is that of
// msahl/post/show/page.py.
import { make } from "./dom.js";
import { readJson } from "./bundles.js";
import { GLOW } from "./model3d.js";
import { codeLine } from "./xmlcode.js";

const MOST_LINES = 20000;
const KINDS = { bodies: "body", joints: "joint", motions: "motion", loads: "load", markers: "marker" };

class DeckPanel {
  constructor(element, data) {
    Object.assign(this, { element, data, file: 0, selected: null, inFront: [] });
    this.texts = data.files.map((file) => this.text(file));
    this.tabs = data.files.map((file, index) => make("button", { type: "button", text: file.name, onclick: () => this.showFile(index) }));
    const parts = [
      make("div", { class: "deck-head" }, make("h2", { text: data.name }), this.verdict()),
      this.faults(),
      this.facts(),
      data.files.length > 1 ? make("nav", { class: "tabs" }, ...this.tabs) : null,
      make("div", { class: "code" }, ...this.texts),
    ];
    element.replaceChildren(...parts.filter(Boolean));
    this.code = element.querySelector(".code");
    this.code.addEventListener("click", (event) => this.clickText(event));
    this.markFaults();
    this.showFile(0);
  }

  verdict() {
    const count = this.data.faults.length;
    const text = count ? `${count} fault${count > 1 ? "s" : ""}` : "no faults";
    return make("span", { class: `word ${count ? "fail" : "pass"}`, text });
  }

  faults() {
    if (!this.data.faults.length) return null;
    const rows = this.data.faults.map((fault) => {
      const where = make("b", { text: fault.where || fault.place });
      const place = make("small", { text: fault.place });
      const row = make("button", { type: "button" }, where, place, make("span", { text: fault.message }));
      if (fault.file !== null && fault.line) row.addEventListener("click", () => this.showLines(fault.file, fault.line, fault.line));
      return make("li", {}, row);
    });
    return make("ul", { class: "faults" }, ...rows);
  }

  facts() {
    if (!this.data.facts.length) return null;
    const [first, ...rest] = this.data.facts.filter((fact) => fact.startsWith("degrees of freedom"));
    const others = this.data.facts.filter((fact) => fact !== first);
    const summary = make("summary", { text: first ?? "About the model" });
    return make("details", { class: "facts" }, summary, ...[...rest, ...others].map((fact) => make("p", { text: fact })));
  }

  text(file) {
    const lines = file.text.split("\n");
    const made = make("pre", { tabindex: 0, "aria-label": file.name });
    const state = { isComment: false, isTag: false };
    lines.slice(0, MOST_LINES).forEach((line, index) => {
      made.append(make("div", { class: "line", "data-line": index + 1 }, make("i", { text: String(index + 1) }), codeLine(line, state)));
    });
    if (lines.length > MOST_LINES) made.append(make("div", { class: "line", text: `(${lines.length - MOST_LINES} more lines)` }));
    return made;
  }

  showFile(index) {
    this.file = index;
    this.texts.forEach((text, place) => (text.hidden = place !== index));
    this.tabs.forEach((tab, place) => tab.setAttribute("aria-pressed", String(place === index)));
  }

  markFaults() {
    for (const { file, line } of this.data.faults) this.texts[file]?.children[line - 1]?.classList.add("faulty");
  }

  // Marks lines of a file and scrolls to the first.
  showLines(file, from, to) {
    this.showFile(file);
    for (const line of this.element.querySelectorAll(".line.chosen")) line.classList.remove("chosen");
    const lines = this.texts[file].children;
    for (let line = from; line <= to; line++) lines[line - 1]?.classList.add("chosen");
    const top = lines[Math.max(from - 4, 0)];
    const all = this.code.getBoundingClientRect();
    const [first, last] = [lines[from - 1], lines[Math.min(to, lines.length) - 1]].map((line) => line?.getBoundingClientRect());
    if (first && (first.top < all.top || last.bottom > all.bottom)) this.code.scrollTop += top.getBoundingClientRect().top - all.top;
  }

  clickText(event) {
    if (String(getSelection())) return;
    const line = Number(event.target.closest(".line")?.dataset.line);
    if (!line) return;
    const found = this.data.elements.find((e) => e.file === this.file && e.from <= line && line <= e.to);
    if (found) this.select(this.kindOf(found), found.name);
  }

  // The viewer's kind of an element of the deck; "" of one that it does not list.
  kindOf({ group, name }) {
    const isSpring = group === "loads" && this.viewer?.models[0].scene.springs.some((spring) => spring.name === name);
    return isSpring ? "spring" : (KINDS[group] ?? "");
  }

  // Selects an element by its kind and name, here and in the viewer.
  select(kind, name) {
    this.viewer?.select({ kind, name }, false);
    this.show({ kind, name });
  }

  // Shows what is selected, { kind, name } or null, in the text; brings it to the front in the view.
  show(selected) {
    this.selected = selected;
    const found = selected && this.data.elements.find((e) => this.kindOf(e) === selected.kind && e.name === selected.name);
    if (found) this.showLines(found.file, found.from, found.to);
    else for (const line of this.element.querySelectorAll(".line.chosen")) line.classList.remove("chosen");
    if (this.viewer) this.bringToFront();
  }

  connect(viewer) {
    this.viewer = viewer;
    viewer.setPanel("tree", viewer.element.clientWidth > 620);
    viewer.setAxes(true);
    for (const body of viewer.models[0].bodies) {
      for (const frame of body.children.filter((child) => child.userData.isFrame)) {
        frame.traverse((object) => object.material && drawInFront(object));
      }
    }
    viewer.element.addEventListener("msahl-selected", ({ detail }) => this.show(detail));
    this.restore();
  }

  // Marks also the joints or the body that a selected load or motion acts on, and draws what is
  // marked in front of the bodies around it.
  bringToFront() {
    const { viewer, selected } = this;
    const model = viewer.models[0];
    for (const [object, material] of this.inFront) Object.assign(object, { material, renderOrder: 0 });
    this.inFront = [];
    model.highlight(selected);
    const targets = new Set(selected ? drawnParts(model.scene, selected) : []);
    model.root.traverse((object) => {
      const { kind, name } = object.userData;
      if (!object.material?.emissive || !targets.has(`${kind} ${name}`)) return;
      this.inFront.push([object, object.material]);
      if (kind === "body") object.material = object.material.clone();
      else drawInFront(object);
      object.material.emissive.set(GLOW);
      object.material.emissiveIntensity = 0.75;
    });
    viewer.invalidate();
  }

  // What is kept when the page is loaded again after the deck was saved.
  keep() {
    const { viewer } = this;
    const camera = viewer && { position: viewer.stage.camera.position.toArray(), target: viewer.stage.controls.target.toArray() };
    const kept = { file: this.data.files[this.file].name, scroll: this.code.scrollTop, selected: this.selected, camera };
    sessionStorage.setItem("msahl-show", JSON.stringify(kept));
  }

  restore() {
    const kept = this.data.version === null ? null : JSON.parse(sessionStorage.getItem("msahl-show"));
    if (!kept) return;
    sessionStorage.removeItem("msahl-show");
    if (this.viewer && kept.camera) {
      this.viewer.stage.isFitted = null;
      this.viewer.stage.camera.position.fromArray(kept.camera.position);
      this.viewer.stage.controls.target.fromArray(kept.camera.target);
      this.viewer.stage.controls.update();
    }
    if (kept.selected) this.select(kept.selected.kind, kept.selected.name);
    const file = this.data.files.findIndex(({ name }) => name === kept.file);
    this.showFile(Math.max(file, 0));
    this.code.scrollTop = kept.scroll;
    this.viewer?.invalidate();
  }

  // Asks the server, which answers when the deck has changed, and loads the page again.
  async monitor() {
    try {
      for (;;) {
        const answer = await fetch(`version?after=${this.data.version}`, { cache: "no-store" });
        if ((await answer.json()).version !== this.data.version) break;
      }
    } catch {
      this.element.querySelector(".deck-head").append(make("small", { class: "ended", text: "no longer updated: msahl show has ended" }));
      return;
    }
    this.keep();
    location.reload();
  }
}

function drawInFront(object) {
  object.material = object.material.clone();
  Object.assign(object.material, { depthTest: false, transparent: true });
  object.renderOrder = 10;
}

// Returns "KIND NAME" of what is drawn of a selected element: itself, or the joints or the body that
// it acts on.
function drawnParts(scene, { kind, name }) {
  const found = [`${kind} ${name}`];
  const entries = { joint: scene.joints, motion: scene.motions, spring: scene.springs, load: scene.loads }[kind] ?? [];
  for (const entry of entries.filter((one) => one.name === name)) {
    const joints = entry.joints ?? (Number.isInteger(entry.joint) ? [entry.joint] : []);
    found.push(...joints.map((joint) => `joint ${scene.joints[joint].name}`));
    if (!joints.length && entry.body >= 0) found.push(`body ${scene.bodies[entry.body].name}`);
  }
  return found;
}

for (const element of document.querySelectorAll("[data-deck]")) {
  const panel = new DeckPanel(element, readJson(element.dataset.deck));
  const holder = document.querySelector("[data-viewer]");
  holder?.addEventListener("msahl-ready", ({ detail }) => panel.connect(detail));
  if (!holder) panel.restore();
  if (panel.data.version !== null) panel.monitor();
}
