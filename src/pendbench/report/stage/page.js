// The page: its views, what people can switch, and the keys.
// When it leaves the truth; where it does not, until when that is known.
function leavesText(act) {
  if (act.leaves !== null) return `${act.leaves.toFixed(2)} s`;
  const times = act.error.t;
  return times.length ? `not by ${Number(times[times.length - 1].toPrecision(2))} s` : "–";
}

// A row of the legend: a box that switches the act, and numbers that follow the time.
function legendRow(act, changed) {
  const row = element("tr");
  const label = element("label");
  const box = element("input");
  box.type = "checkbox";
  box.checked = true;
  const swatch = element("span", "swatch");
  swatch.style.borderTopColor = act.colour;
  if (act.dashes.length) swatch.style.borderTopStyle = "dashed";
  if (act.hollow) swatch.style.borderTopStyle = "double";
  const says = element("span");
  says.append(element("span", "name", act.name), " ", element("span", "detail", act.detail));
  if (act.ended) says.append(element("span", "ended", act.ended));
  label.append(box, swatch, says);
  const cell = element("td");
  cell.append(label);
  const now = element("td", "", "–");
  row.append(cell, now, element("td", "", leavesText(act)));
  box.addEventListener("change", () => {
    act.shown = box.checked;
    row.classList.toggle("off", !act.shown);
    changed();
  });
  return { row, now, act };
}

class LegendView {
  constructor(body, acts, changed) {
    this.rows = acts.map((act) => legendRow(act, changed));
    body.append(...this.rows.map(({ row }) => row));
    this.before = "";
  }

  draw(time) {
    for (const { now, act } of this.rows) {
      const text = numberText(valueAt(act.error, time));
      if (now.textContent !== text) now.textContent = text;
    }
  }
}

// The slider, the time in words, the button, and the note beyond the horizon.
class BarView {
  constructor(clock, truth) {
    Object.assign(this, { clock, truth, slider: byId("time"), now: byId("now"), button: byId("play"), note: byId("note") });
    this.digits = Math.max(2, 2 - Math.floor(Math.log10(clock.duration)));
    this.slider.addEventListener("input", () => { clock.pause(); clock.set(Number(this.slider.value)); });
    this.button.addEventListener("click", () => (clock.playing ? clock.pause() : clock.play()));
  }

  draw(time) {
    const text = `${time.toFixed(Math.min(this.digits, 12))} s`;
    if (this.now.textContent !== text) this.now.textContent = text;
    if (Number(this.slider.value) !== time) this.slider.value = time;
    this.slider.setAttribute("aria-valuetext", text);
    const { playing } = this.clock;
    if (this.button.classList.toggle("on", playing) !== (this.button.getAttribute("aria-label") === "Pause")) {
      this.button.setAttribute("aria-label", playing ? "Pause" : "Play");
    }
    const beyond = Boolean(this.truth) && time > this.truth.horizon * (1 + 1e-9);
    if (this.note.hidden === beyond) this.note.hidden = !beyond;
  }
}

// Hovering over a chart tells its values there; dragging in it sets the time everywhere.
function followChart(chart, clock, acts) {
  const { canvas, key } = chart;
  const timeOf = (event) => chart.timeAt(event.clientX - canvas.getBoundingClientRect().left);
  const tell = (event) => {
    const time = Math.min(Math.max(timeOf(event), 0), clock.duration);
    const told = acts.filter((act) => act.shown && act[key].t.length).map((act) => `${act.name}  ${numberText(valueAt(act[key], time))}`);
    showReadout(event, [`t = ${time.toPrecision(3)} s`, ...told]);
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    clock.pause();
    clock.set(timeOf(event));
  });
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons) clock.set(timeOf(event));
    tell(event);
  });
  canvas.addEventListener("pointerleave", hideReadout);
}

function followStage(view) {
  const { canvas } = view;
  canvas.addEventListener("pointermove", (event) => {
    const box = canvas.getBoundingClientRect();
    const found = view.nearest(event.clientX - box.left, event.clientY - box.top);
    if (!found) return hideReadout();
    const place = [found.x, found.y].map((value) => `${value.toPrecision(4)} m`).join(", ");
    return showReadout(event, [`${found.act.name}${found.tip ? ", tip" : ""}`, place]);
  });
  canvas.addEventListener("pointerleave", hideReadout);
}

function listenToKeys(clock, root) {
  const step = clock.duration / 200;
  const keys = {
    ArrowRight: () => clock.step(step),
    ArrowLeft: () => clock.step(-step),
    Home: () => clock.set(0),
    End: () => clock.set(clock.duration),
    " ": () => (clock.playing ? clock.pause() : clock.play()),
  };
  root.addEventListener("keydown", (event) => {
    const own = event.target.closest("select, summary, button, input[type=checkbox]");
    if (event.altKey || event.ctrlKey || event.metaKey || !keys[event.key]) return;
    if (own && (event.key === " " || own.matches("select"))) return;
    event.preventDefault();
    keys[event.key]();
  });
}

// The stage of a page; keys are heard in `root`.
function startStage(packed, root) {
  const stage = unpackStage(packed);
  const clock = new Clock(stage.duration);
  const scene = new StageView(byId("stage"), stage);
  const error = new ChartView(byId("error"), stage, "error", -16, { value: 1e-2, says: "1 % of the length" });
  const energy = new ChartView(byId("energy"), stage, "energy", -17, null);
  const drawings = [scene, error, energy];
  const redraw = () => { drawings.forEach((view) => view.resize()); clock.wake(); };
  const changed = () => { error.stale = energy.stale = true; clock.wake(); };
  clock.views = [...drawings, new LegendView(byId("legend"), stage.acts, changed), new BarView(clock, stage.truth)];
  new ResizeObserver(redraw).observe(byId("views"));
  for (const chart of [error, energy]) followChart(chart, clock, stage.acts);
  followStage(scene);
  listenToKeys(clock, root);
  byId("speed").addEventListener("change", (event) => { clock.speed = Number(event.target.value); });
  byId("trail").addEventListener("change", (event) => { scene.trail = event.target.value; clock.wake(); });
  byId("view").addEventListener("change", (event) => { scene.side = event.target.value === "side"; clock.wake(); });
  clock.wake();
  return { clock, stage, scene, error, energy, redraw };
}
