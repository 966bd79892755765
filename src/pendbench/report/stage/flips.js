// The map of flip times: zoom into it, and see the pendulum that starts where it is touched.
const STEP_S = 1 / 400; // of what the page computes itself
const FRAME_MS = 9; // how long a frame may compute
const CELLS = 240; // of a zoomed map, each way
const NEVER = 65535;
const TRAIL_POINTS = 300;
const STOPS = [[253, 231, 37], [94, 201, 98], [33, 145, 140], [59, 82, 139], [68, 1, 84]];

// Early is bright; what never flips has the colour of the paper. Colours as a picture keeps them, by time.
class Shades {
  constructor(end, paper) {
    this.end = end;
    this.paper = packedColour(paper);
    this.kept = Uint32Array.from({ length: 513 }, (_, i) => packedColour(blendOf(i / 512)));
  }

  of(time) {
    if (!(time <= this.end)) return this.paper;
    const place = Math.log(time / (0.02 * this.end)) / Math.log(50);
    return this.kept[Math.round(512 * Math.min(Math.max(place, 0), 1))];
  }
}

function packedColour([red, green, blue]) {
  return ((255 << 24) | (blue << 16) | (green << 8) | red) >>> 0;
}

function blendOf(share) {
  const place = share * (STOPS.length - 1);
  const i = Math.min(Math.floor(place), STOPS.length - 2);
  return STOPS[i].map((part, c) => Math.round(part + (place - i) * (STOPS[i + 1][c] - part)));
}

class FlipMap {
  constructor(canvas, data) {
    this.canvas = canvas;
    this.data = data;
    this.size = data.size;
    this.times = new Uint16Array(bytesOf(data.times));
    this.pendulum = new Pendulum(data);
    this.cell = document.createElement("canvas");
    this.home();
  }

  home() {
    this.look({ x: 0, y: 0, span: 2 * Math.PI });
  }

  // Look at a square of the map around (x, y), rad; what is finer than the map is computed, coarse cells first.
  look({ x, y, span }) {
    const most = Math.PI - span / 2;
    this.view = { x: Math.min(Math.max(x, -most), most), y: Math.min(Math.max(y, -most), most), span };
    this.known = null;
    this.queue = null;
    if (span < 2 * Math.PI * 0.999) {
      this.known = new Float32Array(CELLS * CELLS).fill(NaN);
      this.queue = coarseFirst(CELLS);
    }
    this.redraw();
    if (this.queue) requestAnimationFrame(() => this.refine(this.queue));
  }

  zoom(factor, x = this.view.x, y = this.view.y) {
    const span = Math.min(2 * Math.PI, Math.max(1e-7, this.view.span * factor));
    const keep = span / this.view.span;
    this.look({ x: x + (this.view.x - x) * keep, y: y + (this.view.y - y) * keep, span });
  }

  // The two angles at a share of the picture: theta_2 to the right, theta_1 upwards.
  anglesAt(right, down) {
    const { x, y, span } = this.view;
    return [y + span * (0.5 - down), x + span * (right - 0.5)];
  }

  // The map's own time at two angles, s.
  timeAt(one, two) {
    const place = (angle) => Math.min(Math.max(Math.floor(((angle + Math.PI) / (2 * Math.PI)) * this.size), 0), this.size - 1);
    const kept = this.times[place(one) * this.size + place(two)];
    return kept === NEVER ? Infinity : (kept / (NEVER - 1)) * this.data.duration;
  }

  refine(queue) {
    if (queue !== this.queue) return;
    const until = performance.now() + FRAME_MS;
    while (queue.next < queue.cells.length && performance.now() < until) this.computeCell(queue.cells[queue.next++]);
    this.draw();
    if (queue.next < queue.cells.length) requestAnimationFrame(() => this.refine(queue));
  }

  computeCell([column, row, width]) {
    const [one, two] = this.anglesAt((column + width / 2) / CELLS, (row + width / 2) / CELLS);
    const time = this.pendulum.firstFlip(one, two, this.data.duration, STEP_S);
    for (let r = row; r < Math.min(row + width, CELLS); r += 1) {
      const [from, to] = [r * CELLS + column, r * CELLS + Math.min(column + width, CELLS)];
      this.known.fill(time, from, to);
      this.colours.fill(this.shades.of(time), from, to);
    }
  }

  // The colours of what the map itself knows of the part that is looked at.
  paint() {
    const side = this.known ? CELLS : this.size;
    this.cell.width = this.cell.height = side;
    this.image = this.cell.getContext("2d").createImageData(side, side);
    this.colours = new Uint32Array(this.image.data.buffer);
    this.shades = new Shades(this.data.duration, channels(themeColours().card));
    for (let k = 0; k < side * side; k += 1) {
      const time = this.known && !Number.isNaN(this.known[k]) ? this.known[k]
        : this.timeAt(...this.anglesAt(((k % side) + 0.5) / side, (Math.floor(k / side) + 0.5) / side));
      this.colours[k] = this.shades.of(time);
    }
  }

  redraw() {
    this.paint();
    this.draw();
  }

  draw() {
    const { pen, width, height } = sharpen(this.canvas);
    this.cell.getContext("2d").putImageData(this.image, 0, 0);
    pen.imageSmoothingEnabled = false;
    pen.drawImage(this.cell, 0, 0, width, height);
    this.mark(pen, width, height);
  }

  mark(pen, width, height) {
    if (!this.chosen) return;
    const { x, y, span } = this.view;
    const [right, down] = [0.5 + (this.chosen[1] - x) / span, 0.5 - (this.chosen[0] - y) / span];
    pen.lineWidth = 2;
    for (const [radius, colour] of [[8, "#000"], [6, "#fff"]]) {
      pen.strokeStyle = colour;
      pen.beginPath();
      pen.arc(right * width, down * height, radius, 0, 2 * Math.PI);
      pen.stroke();
    }
  }
}

// Squares that cover a map, the large ones first: [column, row, width].
function coarseFirst(side) {
  const cells = [];
  for (let width = 16; width >= 1; width /= 2) {
    for (let row = 0; row < side; row += width) {
      for (let column = 0; column < side; column += width) cells.push([column, row, width]);
    }
  }
  return { cells, next: 0 };
}

// The pendulum that starts at two angles, as it moves.
class Swing {
  constructor(canvas, data) {
    this.canvas = canvas;
    this.data = data;
    this.pendulum = new Pendulum(data);
    this.playing = false;
  }

  start(one, two) {
    this.state = Float64Array.of(one, two, 0, 0);
    this.time = 0;
    this.path = [];
    this.draw();
  }

  play() {
    this.playing = true;
    this.before = performance.now();
    requestAnimationFrame((now) => this.frame(now));
  }

  frame(now) {
    if (!this.playing) return;
    this.advance(Math.min(Math.max(now - this.before, 0), 100) / 1000);
    this.before = now;
    this.draw();
    if (this.time < this.data.duration) requestAnimationFrame((next) => this.frame(next));
    else this.playing = false;
  }

  advance(seconds) {
    const end = Math.min(this.time + seconds, this.data.duration);
    for (let step = 0; this.time < end - 1e-9; step += 1) {
      const h = Math.min(1 / 1000, end - this.time);
      this.pendulum.step(this.state, h);
      this.time += h;
      if (step % 8 === 0) this.path.push(this.tip());
    }
    this.path.splice(0, this.path.length - TRAIL_POINTS);
  }

  elbow() {
    return [this.data.lengths[0] * Math.sin(this.state[0]), -this.data.lengths[0] * Math.cos(this.state[0])];
  }

  tip() {
    const [x, y] = this.elbow();
    return [x + this.data.lengths[1] * Math.sin(this.state[1]), y - this.data.lengths[1] * Math.cos(this.state[1])];
  }

  draw() {
    const { pen, width, height } = sharpen(this.canvas);
    const colours = themeColours();
    const scale = (0.46 * Math.min(width, height)) / (this.data.lengths[0] + this.data.lengths[1]);
    const at = ([x, y]) => [width / 2 + scale * x, height / 2 - scale * y];
    pen.lineCap = pen.lineJoin = "round";
    this.line(pen, this.path.map(at), this.data.colour, 1.2, 0.5);
    this.line(pen, [[0, 0], this.elbow(), this.tip()].map(at), this.data.colour, 3, 1);
    for (const [place, radius, colour] of [[[0, 0], 4, colours.ink], [this.elbow(), 7, this.data.colour], [this.tip(), 7, this.data.colour]]) {
      pen.fillStyle = colour;
      pen.beginPath();
      pen.arc(...at(place), radius, 0, 2 * Math.PI);
      pen.fill();
    }
  }

  line(pen, places, colour, width, alpha) {
    pen.globalAlpha = alpha;
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.beginPath();
    for (const place of places) pen.lineTo(...place);
    pen.stroke();
    pen.globalAlpha = 1;
  }
}

function choose(map, swing, one, two) {
  map.chosen = [one, two];
  map.draw();
  const time = map.timeAt(one, two);
  const angle = (value) => `${value.toFixed(4)} rad`;
  byId("chosen").textContent = `θ₁ = ${angle(one)}, θ₂ = ${angle(two)}: ${Number.isFinite(time) ? `flips after ${time.toFixed(2)} s` : `no flip within ${map.data.duration} s`}`;
  swing.start(one, two);
  if (!window.matchMedia("(prefers-reduced-motion: reduce)").matches) swing.play();
}

function followMap(map, swing) {
  const { canvas } = map;
  const share = (event) => {
    const box = canvas.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  };
  canvas.addEventListener("click", (event) => choose(map, swing, ...map.anglesAt(...share(event))));
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const [one, two] = map.anglesAt(...share(event));
    map.zoom(event.deltaY < 0 ? 0.7 : 1 / 0.7, two, one);
  }, { passive: false });
  const move = (right, up) => map.look({ x: map.view.x + right * map.view.span, y: map.view.y + up * map.view.span, span: map.view.span });
  const keys = {
    "+": () => map.zoom(0.5), "-": () => map.zoom(2), Home: () => map.home(),
    ArrowRight: () => move(0.1, 0), ArrowLeft: () => move(-0.1, 0), ArrowUp: () => move(0, 0.1), ArrowDown: () => move(0, -0.1),
    Enter: () => choose(map, swing, ...map.anglesAt(0.5, 0.5)),
  };
  canvas.addEventListener("keydown", (event) => {
    if (event.altKey || event.ctrlKey || event.metaKey || !keys[event.key]) return;
    event.preventDefault();
    keys[event.key]();
  });
}

function startFlips() {
  const connect = chosenTheme(document.documentElement);
  const data = JSON.parse(byId("data").textContent);
  const [map, swing] = [new FlipMap(byId("map"), data), new Swing(byId("swing"), data)];
  const redraw = () => { map.redraw(); swing.draw(); };
  followMap(map, swing);
  byId("in").addEventListener("click", () => map.zoom(0.5));
  byId("out").addEventListener("click", () => map.zoom(2));
  byId("home").addEventListener("click", () => map.home());
  byId("again").addEventListener("click", () => { swing.start(...map.chosen); swing.play(); });
  choose(map, swing, ...data.start);
  connect(redraw);
  new ResizeObserver(redraw).observe(document.body);
  return { map, swing };
}

window.pendbench = startFlips();
