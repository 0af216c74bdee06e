// The sampled loop at one operating point: plant, regulator, margins and step response, from the tables of the page.
// `data` is what `explorer_data` of hydroctl wrote, `LAWS` the laws of its regulators, printed by `laws_script`; a plant's table has one row for each valve opening.

// The numbers that were written as bytes in base64; `kind` is a typed array.
function decoded(text, kind) {
  return new kind(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
}

// `data` with the table of each plant as rows.
function withRows(data) {
  const plants = data.plants.map((plant) => {
    const values = decoded(plant.rows, Float64Array), width = values.length / data.openings.length;
    return { ...plant, rows: data.openings.map((_, i) => values.subarray(i * width, (i + 1) * width)) };
  });
  return { ...data, plants };
}

// { operatingPoint, A, B } of v/x at opening number `i` and position y: pressures in MPa, speed in m/s.
function linearModel(plant, i, y) {
  const row = plant.rows[i];
  const stiffness = [
    plant.bulk_modulus / (plant.volume_a + plant.area_a * y),
    plant.bulk_modulus / (plant.volume_b - plant.area_b * y),
    1,
  ];
  const A = [0, 1, 2].map((k) => [0, 1, 2].map((j) => stiffness[k] * row[3 * k + j]));
  const B = [0, 1, 2].map((k) => [stiffness[k] * (k < 2 ? row[9 + k] : 0)]);
  return { A, B, operatingPoint: { p_a: row[11], p_b: row[12], v: row[13] } };
}

// The zero of v/x in rad/s.
function zeroOf({ A, B }) {
  const [[b_a], [b_b]] = B, [[a00, a01], [a10, a11], [a20, a21]] = A;
  return -(a20 * (a01 * b_b - a11 * b_a) + a21 * (a10 * b_a - a00 * b_b)) / (a20 * b_a + a21 * b_b);
}

// Poles of v/x in rad/s, { natural, damping } of the pair that does not nearly cancel the zero.
function modesOf(model) {
  const poles = eigenvalues(model.A), zero = zeroOf(model);
  const real = poles.filter((pole) => pole[1] === 0);
  const cancelling = real.reduce((a, b) => (Math.abs(a[0] - zero) <= Math.abs(b[0] - zero) ? a : b));
  const pair = poles.filter((pole) => pole !== cancelling);
  const natural = Math.sqrt(times(pair[0], pair[1])[0]);
  return { poles: [cancelling, ...pair], zero, natural, damping: -(pair[0][0] + pair[1][0]) / (2 * natural) };
}

// The plant with its valve behind hold and delay, sampled: x to v, or x to y for a position loop. Delays are states.
function sampledPlant(data, plant, model) {
  const valve = plant.valve, position = data.loop === "position";
  const n = 3 + (valve ? 2 : 0) + (position ? 1 : 0);
  const drift = zeros(n + 1, n + 1);  // of the states, then of the held command
  for (let k = 0; k < 3; k++) {
    for (let j = 0; j < 3; j++) drift[k][j] = model.A[k][j];
    drift[k][valve ? 3 : n] = model.B[k][0];
  }
  if (valve) {
    drift[3][4] = valve.natural_frequency;
    drift[4][3] = -valve.natural_frequency;
    drift[4][4] = -2 * valve.damping * valve.natural_frequency;
    drift[4][n] = valve.natural_frequency;
  }
  if (position) drift[n - 1][2] = 1;
  const held = (time) => exponential(map(drift, (value) => value * time));
  const whole = Math.floor(data.delay_samples), part = data.delay_samples - whole;
  const total = held(data.Ts), newest = part > 0 ? held(data.Ts * (1 - part)) : total;
  const memory = whole + (part > 0 ? 1 : 0), size = n + memory;
  const A = zeros(size, size), B = zeros(size, 1), C = zeros(1, size);
  const enter = (age, column) => column.forEach((value, k) => { if (age === 0) B[k][0] = value; else A[k][n + age - 1] = value; });
  for (let k = 0; k < n; k++) for (let j = 0; j < n; j++) A[k][j] = total[k][j];
  enter(whole, newest.slice(0, n).map((row) => row[n]));
  if (part > 0) enter(memory, total.slice(0, n).map((row, k) => row[n] - newest[k][n]));
  for (let k = 0; k < memory; k++) if (k === 0) B[n][0] = 1; else A[n + k][n + k - 1] = 1;
  C[0][position ? n - 1 : 2] = 1;
  return { A, B, C, D: [[0]] };
}

// The regulator from (r, m) to x, its filter of the measurement included: what one sample of its law makes of each number of its
// memory and of each input alone. They are so small that nothing is limited, and powers of two, so that nothing is rounded.
function regulatorSystem(data, regulator, gains) {
  const { rest, sample } = LAWS[regulator.law], small = 2 ** -40;
  const names = Object.keys(rest).filter((name) => name !== "x" && name !== "running");
  const answer = (memory, r, m) => {
    const input = { reference: r, v_ref: 0, p_a: 0, p_b: 0, v: m, y: m };
    return map([Object.values(sample({ ...rest, ...memory, running: 1 }, input, gains))], (value) => value / small)[0];
  };
  const order = Object.keys(sample(rest, { reference: 0, v_ref: 0, p_a: 0, p_b: 0, v: 0, y: 0 }, gains));
  const columns = [...names.map((name) => answer({ [name]: small }, 0, 0)), answer({}, small, 0), answer({}, 0, small)];
  const row = (name) => columns.map((column) => column[order.indexOf(name)]);
  const split = (values) => [values.slice(0, names.length), values.slice(names.length)];
  const rows = names.map((name) => split(row(name))), [C, D] = split(row("x"));
  return minimal({ A: rows.map(([a]) => a), B: rows.map(([, b]) => b), C: [C], D: [D] });
}

// { open, closed }: the loop gain L from the error of m to m, and the closed loop from r to m.
function loopOf(regulator, plant) {
  const nr = regulator.A.length, np = plant.A.length;
  const [fromR, fromM] = [0, 1].map((input) => [
    ...regulator.B.map((row) => [row[input]]),
    ...plant.B.map((row) => [row[0] * regulator.D[0][input]]),
  ]);
  const A = block(regulator.A, zeros(nr, np), multiply(plant.B, regulator.C), plant.A);
  const C = [[...new Array(nr).fill(0), ...plant.C[0]]];
  const B = map(fromM, (value) => -value);
  return {
    open: { A, B, C, D: [[0]] },
    closed: { A: map(A, (value, i, j) => value - B[i][0] * C[0][j]), B: fromR, C, D: [[0]] },
  };
}

// Ascending frequencies in rad/s from 1e-4 of the Nyquist frequency to it, dense around the resonance; above it, around its alias.
function frequencies(Ts, { natural, damping }) {
  const nyquist = Math.PI / Ts, width = Math.min(0.9, Math.max(0.02, 3 * damping));
  const coarse = Array.from({ length: 241 }, (_, k) => nyquist * 10 ** (-4 * (1 - k / 240)));
  const swinging = natural * Math.sqrt(Math.max(0, 1 - damping * damping));
  const alias = Math.abs(swinging - 2 * nyquist * Math.round(swinging / (2 * nyquist)));
  const centre = natural < nyquist ? natural : alias;
  const dense = Array.from({ length: 81 }, (_, k) => centre + width * natural * (k / 40 - 1));
  return [...coarse, ...dense.filter((omega) => coarse[0] < omega && omega < nyquist)].sort((a, b) => a - b);
}

// { omega, L, gainCrossings, phaseCrossings, margins } of the open loop; margins in SI, infinite where nothing crosses.
function analyse(open, Ts, modes) {
  const response = frequencyResponse(open);
  const at = (omega) => response([Math.cos(omega * Ts), Math.sin(omega * Ts)]);
  const omega = frequencies(Ts, modes), L = omega.map(at);
  const gainCrossings = crossings(omega, L, at, (value) => modulus(value) - 1);
  const phaseCrossings = crossings(omega, L, at, (value) => value[1]).filter(({ L }) => L[0] < 0);
  const away = ({ L }) => Math.atan2(-L[1], -L[0]);
  const lag = (crossing) => (away(crossing) + 2 * Math.PI) % (2 * Math.PI);
  const sensitivity = (value) => 1 / modulus(plus([1, 0], value));
  const complementary = (value) => modulus(value) * sensitivity(value);
  const Ms = peak(omega, L, at, sensitivity), Mt = peak(omega, L, at, complementary);
  return {
    omega, L, gainCrossings, phaseCrossings,
    margins: {
      Ms: Ms.value,
      Mt: Math.max(Mt.value, complementary(at(1e-8 * omega[0]))),
      gain_margin: Math.min(Infinity, ...phaseCrossings.map(({ L }) => 1 / modulus(L)).filter((factor) => factor > 1)),
      phase_margin: Math.min(Infinity, ...gainCrossings.map((crossing) => Math.abs(away(crossing)))),
      delay_margin: Math.min(Infinity, ...gainCrossings.map((crossing) => lag(crossing) / crossing.omega)),
      crossover: Math.max(0, ...gainCrossings.map((crossing) => crossing.omega)),
    },
  };
}

// All { omega, L } at which `of(L)` changes its sign between two frequencies, by bisection.
function crossings(omega, L, at, of) {
  const found = [];
  for (let k = 0; k + 1 < omega.length; k++) {
    const below = of(L[k]) < 0;
    if (below === of(L[k + 1]) < 0) continue;
    let [low, high] = [omega[k], omega[k + 1]];
    for (let step = 0; step < 52; step++) {
      const middle = (low + high) / 2;
      if (of(at(middle)) < 0 === below) low = middle; else high = middle;
    }
    found.push({ omega: high, L: at(high) });
  }
  return found;
}

// The largest `of(L)`, refined by golden sections between the neighbours of the largest on the grid.
function peak(omega, L, at, of) {
  const values = L.map(of), top = values.indexOf(Math.max(...values));
  if (top === 0 || top === omega.length - 1) return { value: values[top], omega: omega[top] };
  const ratio = (Math.sqrt(5) - 1) / 2;
  let [low, high] = [omega[top - 1], omega[top + 1]];
  let [left, right] = [high - ratio * (high - low), low + ratio * (high - low)];
  let [atLeft, atRight] = [of(at(left)), of(at(right))];
  for (let step = 0; step < 40; step++) {
    if (atLeft > atRight) {
      [high, right, atRight] = [right, left, atLeft];
      left = high - ratio * (high - low);
      atLeft = of(at(left));
    } else {
      [low, left, atLeft] = [left, right, atRight];
      right = low + ratio * (high - low);
      atRight = of(at(right));
    }
  }
  return { value: Math.max(values[top], atLeft, atRight), omega: (low + high) / 2 };
}

// m at the samples after a unit step of r, until it stays within 1 %, and some time longer.
function stepResponse({ A, B, C }, longest = 4000) {
  let state = new Array(A.length).fill(0), last = 0;
  const values = [];
  for (let k = 0; k < longest && k < Math.max(60, 1.3 * last + 10); k++) {
    const value = C[0].reduce((sum, weight, i) => sum + weight * state[i], 0);
    values.push(value);
    if (Math.abs(value - 1) > 0.01) last = k;
    if (Math.abs(value) > 10) break;
    state = A.map((row, i) => row.reduce((sum, weight, j) => sum + weight * state[j], B[i][0]));
  }
  return values;
}

// Everything that the explorer shows at opening number `i` and position y, on one plant with one regulator.
function evaluate(data, plant, regulator, i, y) {
  const x = data.openings[i], gains = LAWS[regulator.law].lookUp(x, y);
  if (plant.reasons[i]) return { x, y, gains, reason: plant.reasons[i] };
  const model = linearModel(plant, i, y), modes = modesOf(model);
  const { open, closed } = loopOf(regulatorSystem(data, regulator, gains), sampledPlant(data, plant, model));
  const poles = eigenvalues(closed.A), stable = modulus(poles[0]) < 1;
  return {
    x, y, gains, modes, poles, stable,
    openPoles: eigenvalues(open.A),
    operatingPoint: model.operatingPoint,
    ...analyse(open, data.Ts, modes),
    step: stepResponse(closed),
  };
}
