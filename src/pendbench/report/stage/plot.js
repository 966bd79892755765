// A plot to be looked into: it tells values, zooms, and shows the engines and methods that are wanted.
const LEAST_DRAG = 6; // px, of what is no click

// Which engines and methods every plot of the page shows.
class Shown {
  constructor() {
    this.off = new Set();
    this.views = [];
  }

  has({ engine, method }) {
    return !this.off.has(engine) && !this.off.has(`${engine}\n${method}`);
  }

  toggle(key) {
    if (!this.off.delete(key)) this.off.add(key);
    for (const view of this.views) view.changed();
  }
}

class PlotView {
  constructor(image, packed, shown) {
    this.panels = packed.panels.map(unpackPanel);
    this.shown = shown;
    this.frame = null;
    this.merged = false;
    this.root = element("div", "plot");
    this.build(packed.title);
    image.closest("p").before(this.root); // what stands in a paragraph is as narrow as text
    image.classList.add("still");
    shown.views.push(this);
    new ResizeObserver(() => this.redraw()).observe(this.root);
  }

  build(title) {
    const head = element("div", "plothead");
    const { x, y } = this.panels[0];
    head.append(element("strong", "", title || this.panels[0].title), element("span", "axes", `↑ ${y.label}   → ${x.label}`));
    this.back = button("all of it", () => this.look(null));
    this.back.hidden = true;
    head.append(this.back);
    if (this.panels.length > 1 && alike(this.panels)) {
      this.together = button("in one panel", () => this.merge(!this.merged));
      this.together.setAttribute("aria-pressed", "false");
      head.append(this.together);
    }
    this.legend = element("div", "chips");
    this.buttons = legendChips(this.legend, this.panels, this.shown);
    this.grid = element("div", "panels");
    this.root.append(head, this.legend, this.grid);
    this.fill(this.panels);
  }

  fill(panels) {
    this.grid.replaceChildren();
    this.grid.classList.toggle("one", panels.length === 1);
    this.views = panels.map((panel) => this.addPanel(panel, panels.length > 1));
  }

  addPanel(panel, named) {
    const figure = element("figure");
    if (named) figure.append(element("figcaption", "", panel.title));
    const canvas = element("canvas");
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${panel.title}: ${panel.y.label} against ${panel.x.label}. Plus and minus zoom, Home shows all of it; the numbers are in the tables`);
    figure.append(canvas, ...panel.notes.map((note) => element("p", "note", note)));
    this.grid.append(figure);
    const view = new PanelView(canvas, panel, this.shown);
    this.follow(view);
    return { view, figure };
  }

  merge(merged) {
    this.merged = merged;
    this.together.setAttribute("aria-pressed", String(merged));
    this.fill(merged ? [together(this.panels)] : this.panels);
    this.look(this.frame);
  }

  look(frame) {
    this.frame = frame;
    this.back.hidden = !frame;
    for (const { view } of this.views) view.look(frame);
    this.redraw();
  }

  changed() {
    for (const { key, made } of this.buttons) made.setAttribute("aria-pressed", String(!this.shown.off.has(key)));
    for (const { view, figure } of this.views) {
      const whose = view.panel.lines.filter((line) => line.mark);
      figure.hidden = whose.length > 0 && !whose.some((line) => this.shown.has(line.mark));
      view.near = null;
    }
    this.redraw();
  }

  redraw() {
    for (const { view, figure } of this.views) {
      if (figure.hidden) continue;
      view.resize();
      view.draw();
    }
    for (const { paint } of this.buttons) paint();
  }

  zoom(factor, view) {
    const now = this.frame || { left: 0, right: 1, bottom: 0, top: 1 };
    const part = (low, high) => {
      const [middle, half] = [(low + high) / 2, Math.min(0.5, ((high - low) * factor) / 2)];
      const from = Math.min(Math.max(middle - half, 0), 1 - 2 * half);
      return [from, from + 2 * half];
    };
    const [[left, right], [bottom, top]] = [part(now.left, now.right), part(now.bottom, now.top)];
    if (view) this.look(right - left > 0.999 ? null : { left, right, bottom, top });
  }

  follow(view) {
    const { canvas } = view;
    const at = (event) => {
      const box = canvas.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    canvas.addEventListener("pointerdown", (event) => {
      const [x, y] = at(event);
      canvas.setPointerCapture(event.pointerId);
      view.drag = { x0: x, y0: y, x1: x, y1: y };
    });
    canvas.addEventListener("pointermove", (event) => this.move(view, event, ...at(event)));
    canvas.addEventListener("pointerup", () => this.drop(view));
    canvas.addEventListener("pointercancel", () => { view.drag = view.box = null; view.draw(); });
    canvas.addEventListener("pointerleave", () => { view.near = null; hideReadout(); view.draw(); });
    canvas.addEventListener("dblclick", () => this.look(null));
    const keys = { "+": () => this.zoom(0.6, view), "-": () => this.zoom(1 / 0.6, view), Home: () => this.look(null) };
    canvas.addEventListener("keydown", (event) => {
      if (event.altKey || event.ctrlKey || event.metaKey || !keys[event.key]) return;
      event.preventDefault();
      keys[event.key]();
    });
  }

  move(view, event, x, y) {
    if (view.drag && event.buttons) {
      Object.assign(view.drag, { x1: x, y1: y });
      view.box = dragged(view.drag) ? view.drag : null;
    }
    view.near = view.box ? null : view.nearest(x, y);
    showReadout(event, view.near ? told(view) : []);
    view.draw();
  }

  drop(view) {
    const { box } = view;
    view.drag = view.box = null;
    if (box) this.look(view.framed(box));
  }
}

function dragged({ x0, y0, x1, y1 }) {
  return Math.abs(x1 - x0) > LEAST_DRAG && Math.abs(y1 - y0) > LEAST_DRAG;
}

function told({ near, panel }) {
  const { line, i } = near;
  const { engine, method, step } = line.mark;
  const value = (axis, at) => {
    const named = axis.ticks.find(([place]) => Math.abs(place - at) < 0.5);
    return axis.ticks.length && !axis.log && named ? named[1] : numberText(at, 3);
  };
  return [[`${engine} ${method}`, step].filter(Boolean).join(", "), `↑ ${value(panel.y, line.ys[i])}`, `→ ${value(panel.x, line.xs[i])}`];
}

// Whether panels have the same axes, so that their lines can share one.
function alike(panels) {
  const key = ({ x, y }) => [x.low, x.high, y.low, y.high].join(" ");
  return panels.every((panel) => key(panel) === key(panels[0]));
}

// All lines of cases in one panel, with what is ruled in any.
function together(panels) {
  const rules = new Map(panels.flatMap((panel) => panel.rules).map((rule) => [`${rule.along} ${rule.value}`, rule]));
  return {
    ...panels[0],
    title: "all",
    lines: panels.flatMap((panel) => panel.lines.filter((line) => line.mark)),
    rules: [...rules.values()],
    notes: [...new Set(panels.flatMap((panel) => panel.notes.map((note) => `${panel.title}: ${note}`)))],
  };
}

function button(text, act) {
  const made = element("button", "", text);
  made.type = "button";
  made.addEventListener("click", act);
  return made;
}

// A button for each engine, one for each of its methods where it has several; and what the dashes mean.
function legendChips(root, panels, shown) {
  const lines = panels.flatMap((panel) => panel.lines).filter((line) => line.mark);
  const made = [];
  const chip = (group, key, text, line) => {
    const one = button("", () => shown.toggle(key));
    one.setAttribute("aria-pressed", String(!shown.off.has(key)));
    const paint = line ? swatch(one, line) : () => {};
    one.append(text);
    group.append(one);
    made.push({ key, made: one, paint });
  };
  for (const engine of new Set(lines.map((line) => line.mark.engine))) {
    const group = element("span", "group");
    const own = lines.filter((line) => line.mark.engine === engine);
    const methods = [...new Set(own.map((line) => line.mark.method))];
    const first = (method) => own.find((line) => line.mark.method === method && line.joined) || own.find((line) => line.mark.method === method);
    chip(group, engine, methods.length > 1 ? engine : `${engine} ${methods[0]}`, methods.length > 1 ? null : first(methods[0]));
    if (methods.length > 1) for (const method of methods) chip(group, `${engine}\n${method}`, method, first(method));
    root.append(group);
  }
  return [...made, ...stepKey(root, lines)];
}

function stepKey(root, lines) {
  const steps = new Map(lines.filter((line) => line.joined && line.mark.step).map((line) => [line.mark.step, line.mark.dashes]));
  if (steps.size < 2) return [];
  const key = element("span", "group key");
  const made = [...steps].map(([text, dashes]) => {
    const one = element("span");
    const paint = swatch(one, { colour: "", width: 1.6, joined: true, marker: "", mark: { dashes, hollow: false } });
    one.append(text);
    key.append(one);
    return { key: "", made: one, paint };
  });
  root.append(key);
  return made;
}

// A bit of a line, as it is drawn; what paints it again in another theme.
function swatch(into, line) {
  const canvas = element("canvas", "swatch");
  canvas.setAttribute("aria-hidden", "true");
  into.append(canvas);
  return () => {
    const drawing = new Drawing(canvas, new Scale(0, 1), new Scale(0, 1));
    const { pen, width, height, colours } = drawing;
    pen.beginPath();
    pen.moveTo(1, height / 2);
    pen.lineTo(width - 1, height / 2);
    const dashes = line.mark.dashes.map((part) => 1.6 * part);
    if (line.joined) drawing.strokeLine({ colour: line.colour || colours.soft, width: Math.min(Math.max(line.width, 1.6), 2.5), dashes, hollow: line.mark.hollow });
    if (line.marker) drawMark(pen, colours, line, width / 2, height / 2, 4);
  };
}

// Every picture of the page that has lines becomes a plot; the picture itself stays for print.
function startPlots(charts) {
  const shown = new Shown();
  for (const image of document.querySelectorAll("img[data-plot]")) {
    const packed = charts[image.dataset.plot];
    if (packed) new PlotView(image, packed, shown);
  }
  return shown;
}
