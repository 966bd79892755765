// A drawing with an axis across and an axis up, each linear or logarithmic.
const LEFT = 46;
const RIGHT = 8;
const TOP = 8;
const BOTTOM = 22;

class Scale {
  // named: ticks that are text, as [value, text]; unit: what the last of the others is followed by.
  constructor(low, high, { log = false, named = [], unit = "" } = {}) {
    Object.assign(this, { low, high, log, named, unit });
    this.from = log ? Math.log10(low) : low;
    this.span = (log ? Math.log10(high) : high) - this.from;
  }

  // Where a value lies: 0 at the low end, 1 at the high end.
  share(value) {
    return ((this.log ? Math.log10(Math.max(value, 1e-300)) : value) - this.from) / this.span;
  }

  value(share) {
    const place = this.from + share * this.span;
    return this.log ? 10 ** place : place;
  }

  between(one, other) {
    return new Scale(this.value(Math.min(one, other)), this.value(Math.max(one, other)), this);
  }

  // At most about so many ticks, as [value, text].
  ticks(most) {
    const inside = ([value]) => value >= this.low * (1 - 1e-9) - 1e-12 * this.span && value <= this.high * (1 + 1e-9);
    if (this.named.length) return this.named.filter(inside);
    if (!this.log || this.span < 1) return this.evenTicks(most);
    return this.decadeTicks(most).filter(inside);
  }

  decadeTicks(most) {
    const [top, bottom] = [Math.floor(this.from + this.span + 1e-9), Math.ceil(this.from - 1e-9)];
    const step = Math.max(1, Math.ceil((top - bottom) / most));
    const found = [];
    for (let decade = top; decade >= bottom; decade -= step) found.push([10 ** decade, decadeText(decade)]);
    return found;
  }

  evenTicks(most) {
    const step = roundStep(this.high - this.low, most);
    const first = Math.ceil(this.low / step - 1e-9);
    const last = Math.floor(this.high / step + 1e-9);
    return Array.from({ length: last - first + 1 }, (_, i) => [(first + i) * step, tickText((first + i) * step, step)]);
  }
}

// A tick with as many digits as tell it from the next.
function tickText(value, step) {
  if (Math.abs(value) < step * 1e-9) return "0";
  const digits = -Math.floor(Math.log10(step) + 1e-9);
  if (digits > 5 || Math.abs(value) >= 1e5) return value.toPrecision(3).replace(/\.?0+(e|$)/, "$1").replace("e+", "e");
  return value.toFixed(Math.max(0, digits));
}

function decadeText(decade) {
  if (decade === 0) return "1";
  if (decade > 0 && decade < 4) return String(10 ** decade);
  return `1e${decade}`;
}

class Drawing {
  constructor(canvas, across, up) {
    Object.assign(this, { canvas, across, up, left: LEFT });
    this.resize();
  }

  resize() {
    Object.assign(this, sharpen(this.canvas));
    this.colours = themeColours();
    this.stale = true;
  }

  get inner() {
    return { width: this.width - this.left - RIGHT, height: this.height - TOP - BOTTOM };
  }

  x(value) {
    return this.left + this.inner.width * this.across.share(value);
  }

  y(value) {
    return TOP + this.inner.height * (1 - this.up.share(value));
  }

  drawAxes() {
    const { pen, colours } = this;
    pen.font = `11px ${FONT}`;
    pen.fillStyle = colours.soft;
    pen.strokeStyle = colours.rule;
    pen.lineWidth = 1;
    pen.textAlign = "right";
    for (const [value, text] of this.up.ticks(this.height / 32)) {
      this.horizontal(this.y(value));
      pen.fillText(text, this.left - 6, this.y(value) + 4);
    }
    pen.textAlign = "center";
    const ticks = this.across.ticks(Math.max(2, this.inner.width / 64));
    ticks.forEach(([value, text], i) => {
      const last = i === ticks.length - 1;
      const told = last && this.across.unit ? `${text} ${this.across.unit}` : text;
      const half = pen.measureText(told).width / 2;
      pen.fillText(told, Math.min(this.x(value), this.width - half - 1), this.height - 6);
    });
  }

  horizontal(y) {
    this.segment(this.left, y, this.width - RIGHT, y);
  }

  vertical(x) {
    this.segment(x, TOP, x, this.height - BOTTOM);
  }

  segment(x0, y0, x1, y1) {
    this.pen.beginPath();
    this.pen.moveTo(x0, y0);
    this.pen.lineTo(x1, y1);
    this.pen.stroke();
  }

  // Draw only between the axes.
  inside(draw) {
    const { pen } = this;
    pen.save();
    pen.beginPath();
    pen.rect(this.left, TOP - 2, this.inner.width, this.inner.height + 4);
    pen.clip();
    pen.lineJoin = "round";
    draw();
    pen.restore();
  }

  // The path that was begun, as a line; a hollow one has a light core.
  strokeLine({ colour, width, dashes = [], hollow = false }) {
    const { pen } = this;
    pen.setLineDash(dashes);
    pen.strokeStyle = this.colours.tone(colour);
    pen.lineWidth = hollow ? width + 1.6 : width;
    pen.stroke();
    pen.setLineDash([]);
    if (!hollow) return;
    pen.strokeStyle = this.colours.card;
    pen.lineWidth = Math.max(0.8, width - 0.4);
    pen.stroke();
  }
}
