// A double pendulum of point masses on massless rods under gravity, advanced by RK4: what a page can run by itself.
class Pendulum {
  constructor({ masses, lengths, gravity }) {
    [this.m1, this.m2] = masses;
    [this.l1, this.l2] = lengths;
    this.g = gravity;
    this.k = [new Float64Array(4), new Float64Array(4), new Float64Array(4), new Float64Array(4)];
    this.y = new Float64Array(4);
  }

  // The rates of change of (theta_1, theta_2, omega_1, omega_2): the equations of motion for two links, solved.
  rates(state, out) {
    const [a, b, u, v] = state;
    const { m1, m2, l1, l2, g } = this;
    const [sin, cos, both] = [Math.sin(a - b), Math.cos(a - b), m1 + m2];
    const under = m1 + m2 * sin * sin;
    out[0] = u;
    out[1] = v;
    out[2] = (m2 * g * Math.sin(b) * cos - both * g * Math.sin(a) - m2 * sin * (l1 * u * u * cos + l2 * v * v)) / (l1 * under);
    out[3] = (both * (g * Math.sin(a) * cos - g * Math.sin(b) + l1 * u * u * sin) + m2 * l2 * v * v * sin * cos) / (l2 * under);
  }

  step(state, h) {
    const { k, y } = this;
    this.rates(state, k[0]);
    for (let stage = 1; stage < 4; stage += 1) {
      const part = stage < 3 ? h / 2 : h;
      for (let i = 0; i < 4; i += 1) y[i] = state[i] + part * k[stage - 1][i];
      this.rates(y, k[stage]);
    }
    for (let i = 0; i < 4; i += 1) state[i] += (h / 6) * (k[0][i] + 2 * k[1][i] + 2 * k[2][i] + k[3][i]);
  }

  // When a rod first goes over the top from rest at two angles, s; Infinity where that is not before the end.
  firstFlip(one, two, end, h) {
    const state = Float64Array.of(one, two, 0, 0);
    const steps = Math.round(end / h);
    for (let i = 0; i < steps; i += 1) {
      const before = [state[0], state[1]];
      this.step(state, h);
      if (Math.abs(state[0]) >= Math.PI || Math.abs(state[1]) >= Math.PI) return h * (i + crossing(before, state));
    }
    return Infinity;
  }
}

// Which share of a step passes before the first of the two angles goes over the top.
function crossing(before, after) {
  const share = (i) => {
    const [from, to] = [Math.abs(before[i]), Math.abs(after[i])];
    return to >= Math.PI ? (Math.PI - from) / (to - from) : 1;
  };
  return Math.min(share(0), share(1));
}
