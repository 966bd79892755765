// The stage: the chains where they are at a time, with the truth behind them.
const TRAIL_S = 1.2;
const TRAIL_SHADES = 10;
const MOST_MASSES = 24; // chains with more links are drawn as lines
const GAP = 10; // px between chains side by side

class StageView {
  constructor(canvas, stage) {
    this.canvas = canvas;
    this.stage = stage;
    this.trail = "short";
    this.side = false;
    this.bounds = boundsOf(stage);
    this.buffer = new Float64Array(2 * mostPoints(stage));
    this.resize();
  }

  resize() {
    Object.assign(this, sharpen(this.canvas));
    this.colours = themeColours();
  }

  // The parts of the canvas and what is drawn in each: one for all, or one for each act that is shown.
  cells() {
    const acts = this.stage.acts.filter((act) => act.shown && act.bodies.length);
    if (!this.side || acts.length < 2) return [{ acts, ...this.frameOf(0, 0, this.width, this.height) }];
    const columns = bestColumns(acts.length, this.width, this.height, this.bounds);
    const rows = Math.ceil(acts.length / columns);
    const [w, h] = [this.width / columns, this.height / rows];
    return acts.map((act, i) => ({
      acts: [act], label: act.name, ...this.frameOf((i % columns) * w, Math.floor(i / columns) * h, w, h),
    }));
  }

  // How metres become px in a part of the canvas.
  frameOf(left, top, width, height) {
    const { low, high } = this.bounds;
    const margin = Math.min(28, 0.08 * Math.min(width, height)) + GAP;
    const room = (size) => Math.max(0, size - 2 * margin); // a page that is folded has none
    const scale = Math.min(room(width) / (high[0] - low[0]), room(height) / (high[1] - low[1]));
    const x = left + width / 2 - (scale * (low[0] + high[0])) / 2;
    const y = top + height / 2 + (scale * (low[1] + high[1])) / 2;
    return { left, top, width, height, scale, x, y };
  }

  draw(time) {
    this.time = time;
    this.pen.clearRect(0, 0, this.width, this.height);
    for (const cell of this.cells()) this.drawCell(cell, time);
  }

  drawCell(cell, time) {
    const { pen } = this;
    pen.lineJoin = "round";
    pen.lineCap = "round";
    this.drawGround(cell);
    const { truth } = this.stage;
    if (truth && time <= truth.horizon * (1 + 1e-9)) this.drawGhost(cell, truth.body, time);
    for (const act of cell.acts) for (const body of act.bodies) this.drawTrail(cell, act, body, time);
    for (const act of cell.acts) for (const body of act.bodies) this.drawBody(cell, act, body, time);
    this.drawPivot(cell, time);
  }

  // Where it is, which is the same for all: some are shaken.
  drawPivot(cell, time) {
    const bodies = cell.acts.length ? cell.acts[0].bodies : everyBody(this.stage);
    if (bodies.length) placesAt(bodies[0], time, this.buffer);
    const [x, y] = bodies.length ? this.buffer : [0, 0];
    this.dot(cell.x + cell.scale * x, cell.y - cell.scale * y, 3.5, this.colours.ink);
  }

  // The name of a part; where there is but one, a length to compare with, and faintly what the straight chain reaches.
  drawGround(cell) {
    const { pen, colours } = this;
    pen.fillStyle = colours.soft;
    pen.font = `12px ${FONT}`;
    pen.textAlign = "left";
    if (cell.label) return pen.fillText(cell.label, cell.left + 16, cell.top + 24);
    pen.strokeStyle = colours.rule;
    pen.lineWidth = 1;
    pen.beginPath();
    pen.arc(cell.x, cell.y, cell.scale * this.stage.length, 0, 2 * Math.PI);
    pen.stroke();
    return this.drawMeasure(cell);
  }

  drawMeasure(cell) {
    const { pen, colours } = this;
    const metres = roundStep(this.stage.length, 4);
    const [x, y, w] = [cell.left + 18, cell.top + cell.height - 16, metres * cell.scale];
    pen.strokeStyle = colours.soft;
    pen.beginPath();
    pen.moveTo(x, y - 4);
    pen.lineTo(x, y);
    pen.lineTo(x + w, y);
    pen.lineTo(x + w, y - 4);
    pen.stroke();
    pen.fillText(`${numberText(metres)} m`, x + w + 8, y + 2);
  }

  drawGhost(cell, body, time) {
    const wide = body.points - 1 <= MOST_MASSES;
    this.path(cell, body, time);
    this.pen.strokeStyle = this.colours.ghost;
    this.pen.lineWidth = wide ? 9 : 6;
    this.pen.stroke();
    if (wide) for (let i = 1; i < body.points; i += 1) this.mass(cell, i, 10, this.colours.ghost);
  }

  drawBody(cell, act, body, time) {
    const { pen } = this;
    const over = time > body.t[body.t.length - 1] * (1 + 1e-9);
    const many = act.bodies.length > 8;
    pen.globalAlpha = over ? 0.35 : many ? 0.55 : 1;
    this.path(cell, body, time);
    pen.strokeStyle = this.colours.tone(body.colour);
    pen.lineWidth = many ? 1 : body.points > 60 ? 2 : 2.5;
    if (act.hollow) pen.lineWidth = 4.5;
    pen.stroke();
    if (act.hollow) this.core();
    if (!many && body.points - 1 <= MOST_MASSES) for (let i = 1; i < body.points; i += 1) this.mass(cell, i, 5.5, this.colours.tone(body.colour), act.hollow);
    else this.mass(cell, body.points - 1, many ? 1.8 : 4, this.colours.tone(body.colour));
    if (over) this.cross(cell, body);
    pen.globalAlpha = 1;
  }

  // The way of the last mass up to now, fading backwards.
  drawTrail(cell, act, body, time) {
    if (this.trail === "0" || act.bodies.length > 60) return;
    const { pen } = this;
    const all = this.trail === "all";
    const from = all ? 0 : Math.max(0, time - TRAIL_S);
    const first = sampleBefore(body.t, from);
    const last = sampleBefore(body.t, time);
    pen.strokeStyle = this.colours.tone(body.colour);
    pen.lineWidth = act.bodies.length > 8 ? 0.8 : 1.8;
    const shades = all ? 1 : TRAIL_SHADES;
    for (let shade = 0; shade < shades; shade += 1) {
      const begin = first + Math.floor(((last - first) * shade) / shades);
      const end = first + Math.floor(((last - first) * (shade + 1)) / shades);
      pen.globalAlpha = all ? 0.4 : 0.65 * ((shade + 1) / shades) ** 1.5;
      this.tipPath(cell, body, begin, end, shade === shades - 1 ? time : NaN);
      pen.stroke();
    }
    pen.globalAlpha = 1;
  }

  tipPath(cell, body, begin, end, time) {
    const { pen } = this;
    const { places, points, unit } = body;
    pen.beginPath();
    for (let i = begin; i <= end; i += 1) {
      const k = 2 * (points * (i + 1) - 1);
      pen.lineTo(cell.x + cell.scale * unit * places[k], cell.y - cell.scale * unit * places[k + 1]);
    }
    if (time <= body.t[body.t.length - 1]) {
      placesAt(body, time, this.buffer);
      const k = 2 * (points - 1);
      pen.lineTo(cell.x + cell.scale * this.buffer[k], cell.y - cell.scale * this.buffer[k + 1]);
    }
  }

  // The chain as a path; its places stay in the buffer.
  path(cell, body, time) {
    const { pen, buffer } = this;
    placesAt(body, time, buffer);
    pen.beginPath();
    for (let i = 0; i < body.points; i += 1) {
      pen.lineTo(cell.x + cell.scale * buffer[2 * i], cell.y - cell.scale * buffer[2 * i + 1]);
    }
  }

  mass(cell, i, radius, colour, hollow = false) {
    const [x, y] = [cell.x + cell.scale * this.buffer[2 * i], cell.y - cell.scale * this.buffer[2 * i + 1]];
    this.dot(x, y, radius, colour);
    if (hollow) this.dot(x, y, radius / 2, this.colours.card);
  }

  // The light core of the path that was just drawn.
  core() {
    this.pen.strokeStyle = this.colours.card;
    this.pen.lineWidth = 1.5;
    this.pen.stroke();
  }

  dot(x, y, radius, colour) {
    this.pen.fillStyle = colour;
    this.pen.beginPath();
    this.pen.arc(x, y, radius, 0, 2 * Math.PI);
    this.pen.fill();
  }

  cross(cell, body) {
    const { pen, buffer } = this;
    const k = 2 * (body.points - 1);
    const [x, y] = [cell.x + cell.scale * buffer[k], cell.y - cell.scale * buffer[k + 1]];
    pen.globalAlpha = 1;
    pen.lineWidth = 2;
    pen.beginPath();
    pen.moveTo(x - 6, y - 6);
    pen.lineTo(x + 6, y + 6);
    pen.moveTo(x + 6, y - 6);
    pen.lineTo(x - 6, y + 6);
    pen.stroke();
  }

  // What lies nearest to a point of the canvas: the act, its point, and where that is, m.
  nearest(x, y) {
    let found = null;
    let closest = 18 * 18;
    for (const cell of this.cells()) {
      for (const act of cell.acts) {
        for (const body of act.bodies) {
          placesAt(body, this.time, this.buffer);
          for (let i = 1; i < body.points; i += 1) {
            const [px, py] = [this.buffer[2 * i], this.buffer[2 * i + 1]];
            const away = (cell.x + cell.scale * px - x) ** 2 + (cell.y - cell.scale * py - y) ** 2;
            if (away < closest) [closest, found] = [away, { act, x: px, y: py, tip: i === body.points - 1 }];
          }
        }
      }
    }
    return found;
  }
}

function everyBody(stage) {
  const bodies = stage.acts.flatMap((act) => act.bodies);
  return stage.truth ? [stage.truth.body, ...bodies] : bodies;
}

function mostPoints(stage) {
  return Math.max(1, ...everyBody(stage).map((body) => body.points));
}

// What all bodies reach, m, and the pivot.
function boundsOf(stage) {
  const low = [0, 0];
  const high = [0, 0];
  for (const { places, unit } of everyBody(stage)) {
    for (let k = 0; k < places.length; k += 1) {
      const value = unit * places[k];
      if (value < low[k & 1]) low[k & 1] = value;
      if (value > high[k & 1]) high[k & 1] = value;
    }
  }
  const least = 0.25 * stage.length;
  for (const axis of [0, 1]) {
    const short = (least - (high[axis] - low[axis])) / 2;
    if (short > 0) [low[axis], high[axis]] = [low[axis] - short, high[axis] + short];
  }
  return { low, high };
}

// How many columns leave the chains largest.
function bestColumns(count, width, height, bounds) {
  const [w, h] = [bounds.high[0] - bounds.low[0], bounds.high[1] - bounds.low[1]];
  let [best, largest] = [1, 0];
  for (let columns = 1; columns <= count; columns += 1) {
    const scale = Math.min(width / columns / w, height / Math.ceil(count / columns) / h);
    if (scale > largest) [best, largest] = [columns, scale];
  }
  return best;
}
