/* The look-up table of softflagella for web pages and Node: the steady motion of a robot, and its response to
   a flip.

   import { readLookup } from "./lookup.js";
   const table = readLookup(await (await fetch("lookup.safetensors")).arrayBuffer());
   const robot = { C_t: 3, C_r: 2.8, C_yr: 2, l_over_R: 6.875, L_over_R: 3.75, l_over_r0: 34.375,
                   omega_bar: 10, N: 2, a_over_R: 1 };
   table.query(robot).omega_yr_bar;            // null: no such robot, or no motion found
   table.response(robot, 0.8).net_speed_bar;   // flips with equal dwells; null for one tail
   table.query(robot).outside;                 // true: not a robot as the table has learned them

   Lengths are in tail lengths l, times in mu0 l^4/EI, angles in rad but for theta_deg. The formulas are those of
   surrogate/wrench/tails.py and surrogate/wrench/heads.py; the balance of forces is solved by Broyden's method. */

const STEPS = 60, DIFFERENCE = 1e-6, CORRECTION = 1e-9;

export function readLookup(buffer) {
  const view = new DataView(buffer);
  const length = Number(view.getBigUint64(0, true));
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, length)));
  const manifest = JSON.parse(header.__metadata__.manifest);
  if (manifest.format !== 1) throw new Error(`this reader knows format 1, the file has ${manifest.format}`);
  const arrays = {};
  delete header.__metadata__;
  for (const [name, { dtype, shape, data_offsets: [from, to] }] of Object.entries(header)) {
    const size = dtype === "F16" ? 2 : 4;
    const values = new Float64Array((to - from) / size);
    for (let i = 0; i < values.length; i++) {
      const at = 8 + length + from + size * i;
      values[i] = size === 2 ? half(view.getUint16(at, true)) : view.getFloat32(at, true);
    }
    arrays[name] = { shape, values };
  }
  const networks = {};
  for (const name of manifest.networks) networks[name] = network(arrays, name);
  return new Lookup(manifest, networks, arrays);
}

function half(bits) {
  const exponent = (bits >> 10) & 31, digits = bits & 1023;
  const size = exponent ? (1 + digits / 1024) * 2 ** (exponent - 15) : digits * 2 ** -24;
  return bits & 0x8000 ? -size : size;
}

/* A function from inputs to outputs. */
function network(arrays, name) {
  const part = (key) => arrays[`${name}.${key}`].values;
  const layers = [];
  while (`${name}.weights.${layers.length}` in arrays) {
    const i = layers.length;
    layers.push({ weights: part(`weights.${i}`), biases: part(`biases.${i}`) });
  }
  const [shift, scale, mean, spread, bypass] = ["shift", "scale", "mean", "spread", "bypass"].map(part);
  const times = (h, weights, sum) => {
    h.forEach((factor, i) => {
      for (let j = 0; j < sum.length; j++) sum[j] += factor * weights[i * sum.length + j];
    });
    return sum;
  };
  return (inputs) => { // of more inputs than it has, a network takes the first
    const first = inputs.slice(0, shift.length).map((x, i) => (x - shift[i]) / scale[i]);
    let h = first;
    for (const { weights, biases } of layers.slice(0, -1)) {
      h = times(h, weights, Float64Array.from(biases)).map(Math.tanh);
    }
    const { weights, biases } = layers[layers.length - 1];
    const last = times(h, weights, Float64Array.from(biases));
    return times(first, bypass, last).map((y, j) => y * spread[j] + mean[j]);
  };
}

const thrustOf = (S) => (0.125 * S) / (1 + (S / 8) ** 1.35);
const torqueOf = (S) => (1 + (S / 6) ** 2) ** -0.125;

class Lookup {
  constructor(manifest, networks, arrays) {
    Object.assign(this, { manifest, networks, arrays });
  }

  query(robot) {
    const body = this.#solved(robot);
    return body && this.#motion(robot, body);
  }

  response(robot, dwell) {
    const { dwells } = this.manifest;
    const body = robot.N > 1.5 && dwells.length && dwell >= dwells[0] * (1 - 1e-9) ? this.#solved(robot) : null;
    if (!body) return null;
    const motion = this.#motion(robot, body), [v_x, v_z, yaw] = body.u;
    const sway = v_x + (yaw * body.length) / 2;
    const [z, x, psi] = this.#lags(body, dwell, [Math.hypot(v_z, sway / 10), sway, yaw]);
    const angle = yaw * dwell, along = (dwell * Math.sin(angle)) / angle;
    const across = (dwell * 2 * Math.sin(angle / 2) ** 2) / angle;
    const ahead = along * v_z - across * sway, left = across * v_z + along * sway;
    const way = z + Math.cos(psi) * ahead - Math.sin(psi) * left;
    const aside = x + Math.sin(psi) * ahead + Math.cos(psi) * left;
    const c = Math.cos(angle + psi), s = Math.sin(angle + psi);
    const moved = Math.hypot(way + c * way + s * aside, aside + s * way - c * aside);
    return { net_speed_bar: moved / (2 * dwell), lag_psi_rad: psi, lag_x: x, lag_z: z, outside: motion.outside };
  }

  /* Numbers of a robot and its motion u: v_x of the disc, v_z, yaw rate, spin of the head; null: not found. */
  #solved(robot) {
    const { C_t, C_r, C_yr, l_over_R, L_over_R, l_over_r0, omega_bar, N, a_over_R } = robot;
    const positive = [C_t, C_r, C_yr, l_over_R, L_over_R, a_over_R].every((value) => value > 0);
    if (!(positive && l_over_r0 > 5 && N >= 1 && omega_bar)) return null;
    const R = 1 / l_over_R, length = L_over_R * R, logSlender = Math.log(l_over_r0);
    const body = {
      N, length, slender: l_over_r0, sense: Math.sign(omega_bar), speed: Math.abs(omega_bar), offset: a_over_R * R,
      along: (2 * Math.PI) / (logSlender - 0.5), across: (4 * Math.PI) / (logSlender + 0.5),
      drag: 6 * Math.PI * C_t * R, spinDrag: 8 * Math.PI * C_r * R ** 3, side: C_yr * R * length,
      wrench: this.networks[N < 2 ? "one_tail" : N < 3 ? "two_tails" : "more_tails"],
    };
    return body.wrench && solve(body) ? body : null;
  }

  #motion(robot, body) {
    const [v_x, v_z, yaw, headSpin] = body.u, spin = body.speed + headSpin, sway = v_x + (yaw * body.length) / 2;
    const share = this.networks.gap([...tailInputs(body, body.u), Math.log(body.N)])[0];
    const within = Object.entries(this.manifest.domain).every(([name, [low, high]]) => {
      const size = Math.abs(robot[name]);
      return low * (1 - 1e-6) <= size && size <= high * (1 + 1e-6);
    });
    return {
      omega_t_bar: body.sense * spin, omega_h_bar: body.sense * headSpin, omega_yr_bar: body.sense * yaw,
      v_x: body.sense * sway, v_z, R_yr_over_l: Math.hypot(sway, v_z) / Math.abs(yaw),
      theta_deg: (180 / Math.PI) * Math.atan2(Math.abs(sway), v_z),
      tail_gap: body.N < 1.5 ? Infinity : share * body.offset * Math.sin(Math.PI / body.N) * body.slender,
      outside: !within || Math.abs(yaw) > 0.6 * spin,
    };
  }

  /* Lags (z, x, psi) at a dwell, cubic in ln dwell through four of the dwells of the table. */
  #lags(body, dwell, speeds) {
    const total = body.N * body.across, { dwells } = this.manifest, logs = dwells.map(Math.log);
    const [sway, surge, turn, length, , side, disc] = headInputs(body);
    const inputs = [...tailInputs(body, body.u), sway, surge, turn, length, side, disc, Math.log(body.N),
      body.N < 2.5 ? 1 : 0];
    const c = [...this.networks.lag(inputs), ...this.networks.memory(inputs)];
    const mean = this.arrays["curves.mean"].values, basis = this.arrays["curves.basis"].values;
    const place = Math.log(Math.min(dwell, dwells[dwells.length - 1])), lag = [0, 0, 0];
    let first = 0;
    while (first < logs.length - 4 && logs[first + 2] < place) first++;
    for (let i = first; i < first + 4; i++) {
      let weight = 1;
      for (let j = first; j < first + 4; j++) if (j !== i) weight *= (place - logs[j]) / (logs[i] - logs[j]);
      for (let p = 0; p < 3; p++) {
        const curve = c.reduce((sum, part, k) => sum + part * basis[k * mean.length + 3 * i + p], mean[3 * i + p]);
        lag[p] += weight * curve * speeds[p];
      }
    }
    return lag;
  }
}

function tailInputs(body, u) {
  const spin = body.speed + u[3], S = body.across * spin;
  return [
    Math.log(S), Math.log(body.offset), Math.log(body.slender),
    Math.asinh(((20 * Math.hypot(u[0], u[2])) / spin) * (S / (S + 12))),
    Math.atan2(u[0], u[2]), Math.asinh((20 * u[1]) / (body.offset * spin)),
    Math.log(body.spinDrag / (body.N * body.across * body.offset ** 2)),
  ];
}

/* What a single tail feels of its head. */
function headInputs(body) {
  const total = body.N * body.across, drag = Math.log(body.drag / total);
  return [drag, drag, drag + 2 * Math.log(body.length / 2), Math.log(body.length), 1, Math.log(body.side / total), 0];
}

const numbersAt = (body, u) => body.wrench([...tailInputs(body, u), ...headInputs(body)]);

/* Forces (x, z) and moments (y, z) about the disc that are left at the velocities u, for numbers y of the tails. */
function unbalanced(body, u, y) {
  const [v_x, v_z, yaw, headSpin] = u;
  const spin = body.speed + headSpin, S = body.across * spin;
  const across = body.N * body.across, lever = body.length / 2;
  const sideways = Math.hypot(v_x, yaw), squared = (sideways / (body.offset * spin)) ** 2;
  const couple = body.N * spin * body.offset ** 2;
  const thrust = (body.across - body.along) * couple * thrustOf(S), torque = body.across * couple * torqueOf(S);
  const onHead = body.drag * (v_x + lever * yaw) + body.side * headSpin;
  return [
    across * (yaw / 2 - v_x) + across * sideways * y[0] - onHead,
    thrust * (y[1] + squared * y[4]) - (body.N * body.along + body.drag) * v_z,
    across * (v_x / 2 - yaw / 3) + across * sideways * y[2] - lever * onHead,
    -torque * (y[3] + squared * y[5]) - body.spinDrag * headSpin,
  ];
}

/* The first guess: linear theory for the tails' torque and thrust, straight tails for the side forces. */
function guess(body) {
  const across = body.N * body.across, lever = body.length / 2;
  let spin = 0.6 * body.speed;
  for (let i = 0; i < 3; i++) {
    const torque = across * body.offset ** 2 * torqueOf(body.across * spin);
    spin = (body.speed * body.spinDrag) / (body.spinDrag + torque);
  }
  const headSpin = spin - body.speed, push = -body.side * headSpin;
  const thrust = body.N * (body.across - body.along) * spin * body.offset ** 2 * thrustOf(body.across * spin);
  const a = body.drag + across, b = body.drag * lever - across / 2, d = body.drag * lever ** 2 + across / 3;
  const size = a * d - b * b;
  return [(push * (d - b * lever)) / size, thrust / (body.drag + body.N * body.along),
    (push * (a * lever - b)) / size, headSpin];
}

/* The table of a single tail has second solutions near the true one. So two are sought, and the one whose surge is
   nearer to the first guess counts. */
function solve(body) {
  const first = guess(body);
  let u = solveFrom(body, first, false);
  const other = body.N < 1.5 ? solveFrom(body, first, true) : null;
  if (other && (!u || Math.abs(other[1] - first[1]) < Math.abs(u[1] - first[1]))) u = other;
  body.u = u;
  return u !== null;
}

/* The velocities in balance from a first guess; null if none were found. */
function solveFrom(body, first, exact) {
  let u = first;
  const y = numbersAt(body, u);
  let left = unbalanced(body, u, y), inverse = invertedSlope(body, u, exact ? null : y, left);
  if (!inverse) return null;
  const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
  for (let count = 0; count < STEPS; count++) {
    let way = inverse.map((row) => -dot(row, left));
    const shorter = Math.min(0.5 / (Math.abs(way[3]) / (body.speed + u[3])), 1);
    way = way.map((part) => part * shorter);
    u = u.map((part, i) => part + way[i]);
    const moved = Math.max(Math.abs(way[0]), Math.abs(way[1])) / (Math.hypot(u[0], u[1]) + Math.abs(u[2]));
    if (Math.max(moved, Math.abs(way[2] / u[2]), Math.abs(way[3] / u[3])) < CORRECTION) {
      return u.every(Number.isFinite) && body.speed + u[3] > 0 ? u : null;
    }
    const now = unbalanced(body, u, numbersAt(body, u)), change = now.map((part, i) => part - left[i]);
    const missed = inverse.map((row, i) => way[i] - dot(row, change));
    const along = inverse.map((_, j) => dot(way, inverse.map((row) => row[j])));
    const size = dot(along, change);
    if (size) inverse = inverse.map((row, i) => row.map((part, j) => part + (missed[i] * along[j]) / size));
    left = now;
  }
  return null;
}

/* The inverse of the derivative of what is unbalanced, by differences and elimination, with the tails' numbers held
   at y if they are given; null if there is none. */
function invertedSlope(body, u, y, left) {
  const largest = Math.max(...u.map(Math.abs));
  const rows = left.map((_, i) => [0, 1, 2, 3, 4, 5, 6, 7].map((j) => +(j - 4 === i)));
  for (let j = 0; j < 4; j++) {
    const width = DIFFERENCE * (Math.abs(u[j]) + 1e-3 * largest);
    const moved = u.map((part, i) => (i === j ? part + width : part));
    unbalanced(body, moved, y ?? numbersAt(body, moved)).forEach((part, i) => {
      rows[i][j] = (part - left[i]) / width;
    });
  }
  for (let k = 0; k < 4; k++) {
    let best = k;
    for (let i = k + 1; i < 4; i++) if (Math.abs(rows[i][k]) > Math.abs(rows[best][k])) best = i;
    if (!(Math.abs(rows[best][k]) > 0)) return null;
    [rows[k], rows[best]] = [rows[best], rows[k]];
    rows[k] = rows[k].map((part) => part / rows[k][k]);
    for (let i = 0; i < 4; i++) {
      const share = rows[i][k];
      if (i !== k) rows[i] = rows[i].map((part, j) => part - share * rows[k][j]);
    }
  }
  return rows.map((row) => row.slice(4));
}
