// A panel of a plot: its lines between its axes, with what is pointed at brought forward.
const REACH = 26; // px, from the pointer to a point
const MARGIN = 0.25; // of the axis, that is packed beyond each end

function unpackLine(packed, across, up) {
  const places = new Uint16Array(bytesOf(packed.points));
  const at = (scale, k) => scale.value((places[k] / 65535) * (1 + 2 * MARGIN) - MARGIN);
  const count = places.length / 2;
  return {
    ...packed,
    xs: Float64Array.from({ length: count }, (_, i) => at(across, 2 * i)),
    ys: Float64Array.from({ length: count }, (_, i) => at(up, 2 * i + 1)),
  };
}

function unpackPanel(packed) {
  const across = new Scale(packed.x.low, packed.x.high, { log: packed.x.log, named: packed.x.ticks });
  const up = new Scale(packed.y.low, packed.y.high, { log: packed.y.log, named: packed.y.ticks });
  return { ...packed, across, up, lines: packed.lines.map((line) => unpackLine(line, across, up)) };
}

class PanelView extends Drawing {
  constructor(canvas, panel, shown) {
    super(canvas, panel.across, panel.up);
    Object.assign(this, { panel, shown, near: null, frame: null });
  }

  resize() {
    super.resize();
    this.pen.font = `11px ${FONT}`;
    const widths = this.up.named.map(([, text]) => this.pen.measureText(text).width);
    this.left = Math.min(Math.max(LEFT, ...widths.map((width) => width + 12)), this.width / 2);
  }

  // What is shown of the panel: all of it, or what lies between these shares of it.
  look(frame) {
    this.across = frame ? this.panel.across.between(frame.left, frame.right) : this.panel.across;
    this.up = frame ? this.panel.up.between(frame.bottom, frame.top) : this.panel.up;
    this.near = null;
  }

  lines() {
    return this.panel.lines.filter((line) => !line.mark || this.shown.has(line.mark));
  }

  draw() {
    const { pen } = this;
    pen.clearRect(0, 0, this.width, this.height);
    this.drawAxes();
    this.inside(() => {
      for (const rule of this.panel.rules) this.drawRule(rule);
      for (const line of this.lines()) this.drawLine(line);
      if (this.near) this.drawLine(this.near.line, true);
    });
    if (this.near) this.ring();
    if (this.box) this.drawBox();
  }

  drawRule({ along, value, text }) {
    const { pen, colours } = this;
    pen.strokeStyle = pen.fillStyle = colours.soft;
    pen.lineWidth = 1;
    pen.font = `11px ${FONT}`;
    pen.textAlign = "right";
    if (along === "y") {
      this.horizontal(this.y(value));
      return pen.fillText(text, this.width - RIGHT - 4, this.y(value) - 4);
    }
    this.vertical(this.x(value));
    return pen.fillText(text, this.x(value) - 5, this.height - BOTTOM - 6);
  }

  drawLine(line, forward = false) {
    const { pen } = this;
    const whose = line.mark;
    pen.globalAlpha = this.near && !forward && whose ? 0.3 : 1;
    const colour = whose ? line.colour : this.colours[line.strong ? "ink" : "soft"];
    if (line.joined && line.xs.length > 1) {
      this.path(line);
      const dashes = whose && whose.dashes.length ? whose.dashes.map((part) => 1.6 * part) : line.dashed ? [5, 4] : [];
      this.strokeLine({ colour, width: forward ? line.width + 1 : line.width, dashes, hollow: Boolean(whose && whose.hollow) });
    }
    if (line.marker) for (let i = 0; i < line.xs.length; i += 1) drawMark(pen, this.colours, line, this.x(line.xs[i]), this.y(line.ys[i]));
    pen.globalAlpha = 1;
  }

  path({ xs, ys, stairs }) {
    const { pen } = this;
    pen.beginPath();
    for (let i = 0; i < xs.length; i += 1) {
      if (stairs && i) pen.lineTo(this.x(xs[i]), this.y(ys[i - 1]));
      pen.lineTo(this.x(xs[i]), this.y(ys[i]));
    }
  }

  ring() {
    const { pen } = this;
    const { line, i } = this.near;
    pen.strokeStyle = this.colours.ink;
    pen.lineWidth = 1.6;
    pen.beginPath();
    pen.arc(this.x(line.xs[i]), this.y(line.ys[i]), 7, 0, 2 * Math.PI);
    pen.stroke();
  }

  drawBox() {
    const { pen, box, colours } = this;
    pen.fillStyle = colours.beyond;
    pen.strokeStyle = colours.soft;
    pen.lineWidth = 1;
    const size = [Math.min(box.x0, box.x1), Math.min(box.y0, box.y1), Math.abs(box.x1 - box.x0), Math.abs(box.y1 - box.y0)];
    pen.fillRect(...size);
    pen.strokeRect(...size);
  }

  // The point that lies nearest to a place of the canvas, px, of the lines that are a case's.
  nearest(x, y) {
    let [found, closest] = [null, REACH * REACH];
    for (const line of this.lines()) {
      if (!line.mark) continue;
      for (let i = 0; i < line.xs.length; i += 1) {
        const away = (this.x(line.xs[i]) - x) ** 2 + (this.y(line.ys[i]) - y) ** 2;
        if (away < closest) [closest, found] = [away, { line, i }];
      }
    }
    return found;
  }

  // The shares of the whole panel between two places of the canvas, px.
  framed({ x0, y0, x1, y1 }) {
    const across = [x0, x1].map((x) => this.panel.across.share(this.across.value((x - this.left) / this.inner.width)));
    const up = [y0, y1].map((y) => this.panel.up.share(this.up.value(1 - (y - TOP) / this.inner.height)));
    const within = (value) => Math.min(Math.max(value, 0), 1);
    return {
      left: within(Math.min(...across)), right: within(Math.max(...across)),
      bottom: within(Math.min(...up)), top: within(Math.max(...up)),
    };
  }
}
