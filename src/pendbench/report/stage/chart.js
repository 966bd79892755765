// A quantity against time on a logarithmic axis, for every act that is shown. The lines are drawn once and kept.
class ChartView extends Drawing {
  constructor(canvas, stage, key, floor, line) {
    const [low, high] = decadesOf(stage.acts.map((act) => act[key]), floor);
    super(canvas, new Scale(0, stage.duration, { unit: "s" }), new Scale(10 ** low, 10 ** high, { log: true }));
    Object.assign(this, { stage, key, line, kept: document.createElement("canvas") });
  }

  // What is beyond the axis is drawn at its edge.
  y(value) {
    return TOP + this.inner.height * (1 - Math.min(Math.max(this.up.share(value), -0.02), 1));
  }

  timeAt(x) {
    return this.across.value((x - this.left) / this.inner.width);
  }

  draw(time) {
    if (this.stale) this.keep();
    const { pen } = this;
    pen.clearRect(0, 0, this.width, this.height);
    pen.drawImage(this.kept, 0, 0, this.width, this.height);
    pen.strokeStyle = this.colours.ink;
    pen.lineWidth = 1;
    this.vertical(this.x(time));
    for (const act of this.stage.acts) if (act.shown) this.point(act, time);
  }

  point(act, time) {
    const value = valueAt(act[this.key], time);
    if (!(value > this.up.low)) return;
    const { pen } = this;
    const colour = this.colours.tone(act.colour);
    pen.fillStyle = act.hollow ? this.colours.card : colour;
    pen.strokeStyle = act.hollow ? colour : this.colours.card;
    pen.lineWidth = act.hollow ? 2 : 1.5;
    pen.beginPath();
    pen.arc(this.x(time), this.y(value), 4.5, 0, 2 * Math.PI);
    pen.fill();
    pen.stroke();
  }

  // Draw what does not change with time onto a canvas of its own.
  keep() {
    this.stale = false;
    this.kept.width = this.canvas.width;
    this.kept.height = this.canvas.height;
    const shown = this.pen;
    this.pen = this.kept.getContext("2d");
    this.pen.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    this.drawAxes();
    this.drawBeyond();
    this.inside(() => this.drawLines());
    if (this.line && this.line.value <= this.up.high) this.drawThreshold();
    this.pen = shown;
  }

  drawThreshold() {
    const { pen, colours } = this;
    pen.save();
    pen.strokeStyle = colours.soft;
    pen.lineWidth = 1;
    pen.setLineDash([2, 4]);
    this.horizontal(this.y(this.line.value));
    pen.textAlign = "left";
    const y = this.y(this.line.value);
    pen.setLineDash([]);
    pen.font = `11px ${FONT}`;
    pen.strokeStyle = colours.card;
    pen.lineWidth = 4;
    pen.fillStyle = colours.soft;
    pen.strokeText(this.line.says, this.left + 6, y < TOP + 14 ? y + 13 : y - 4);
    pen.fillText(this.line.says, this.left + 6, y < TOP + 14 ? y + 13 : y - 4);
    pen.restore();
  }

  // The horizon, and grey where nobody knows.
  drawBeyond() {
    const { pen, colours, stage } = this;
    if (!stage.truth || stage.truth.horizon >= stage.duration * (1 - 1e-9) || this.key !== "error") return;
    const x = this.x(stage.truth.horizon);
    pen.fillStyle = colours.beyond;
    pen.fillRect(x, TOP, this.width - RIGHT - x, this.inner.height);
    pen.strokeStyle = colours.ink;
    pen.lineWidth = 1;
    this.vertical(x);
    this.sayBeyond(x);
  }

  // In two lines, where there is room for them.
  sayBeyond(x) {
    const { pen, colours } = this;
    const words = this.stage.truth.ends.split(" ");
    const half = Math.ceil(words.length / 2);
    const lines = [words.slice(0, half).join(" "), words.slice(half).join(" ")];
    pen.font = `italic 12px ${FONT}`;
    pen.fillStyle = colours.soft;
    const room = this.width - RIGHT - x;
    const middle = TOP + this.inner.height / 2;
    pen.textAlign = "center";
    if (room > Math.max(...lines.map((line) => pen.measureText(line).width)) + 8) {
      lines.forEach((line, i) => pen.fillText(line, x + room / 2, middle + 16 * i));
    }
  }

  drawLines() {
    const { colours, stage } = this;
    if (this.key === "error" && stage.truth) this.drawLine(stage.truth.bound, { colour: colours.ghostInk, dashes: [1, 3], width: 1 });
    const shown = stage.acts.filter((act) => act.shown);
    shown.forEach((act, i) => this.drawLine(act[this.key], { ...act, width: Math.min(3, 1.4 + 0.4 * (shown.length - 1 - i)) }));
  }

  drawLine(curve, style) {
    this.pen.beginPath();
    for (let i = 0; i < curve.t.length; i += 1) {
      if (curve.values[i] > 0) this.pen.lineTo(this.x(curve.t[i]), this.y(curve.values[i]));
    }
    this.strokeLine(style);
  }
}

// Whole decades around what the curves show, not below the floor.
function decadesOf(curves, floor) {
  let [low, high] = [Infinity, -Infinity];
  for (const { values } of curves) {
    for (const value of values) {
      if (value > 0) [low, high] = [Math.min(low, value), Math.max(high, value)];
    }
  }
  if (!(high > 0)) return [-3, 0];
  const top = Math.min(2, Math.ceil(Math.log10(high) - 1e-6));
  const bottom = Math.max(floor, Math.floor(Math.log10(low)));
  return [Math.min(bottom, top - 2), top];
}
