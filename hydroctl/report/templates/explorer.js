// The controls of the page, and what the explorer shows.

const page = JSON.parse(byId("data").textContent);
const data = withRows(page.explorer);
const HERTZ = 0.5 / Math.PI, DEGREES = 180 / Math.PI, POSITIONS = 500;
const GAIN_NAMES = ["kp", "ki", "kd", "notch_frequency"];
const MARGINS = [
  ["Ms", "Ms", 1, ""], ["Mt", "Mt", 1, ""], ["gain_margin", "gain margin", 1, ""], ["phase_margin", "phase margin", DEGREES, "degrees"],
  ["delay_margin", "delay margin", 1e3, "ms"], ["crossover", "crossover", HERTZ, "Hz"],
];

function positionAt(index) {
  return (data.stroke * index) / POSITIONS;
}

// Moves the sliders to the nearest opening and position, and to a plant by its label.
function show(x, y, plant) {
  const distances = data.openings.map((opening) => Math.abs(opening - x));
  byId("opening").value = distances.indexOf(Math.min(...distances));
  byId("position").value = Math.round((y / data.stroke) * POSITIONS);
  if (plant !== undefined) byId("plant").value = data.plants.findIndex(({ label }) => label === plant);
  refresh();
  byId("explorer").scrollIntoView();
  byId("opening").focus({ preventScroll: true });
}

function refresh() {
  const [i, index, plant, regulator] = ["opening", "position", "plant", "regulator"].map((id) => Number(byId(id).value));
  const result = evaluate(data, data.plants[plant], data.regulators[regulator], i, positionAt(index));
  const [x, y] = [`${short(result.x)}`, `${short(result.y)} m`];
  byId("opening-value").textContent = x;
  byId("position-value").textContent = y;
  byId("opening").setAttribute("aria-valuetext", `x = ${x}`);
  byId("position").setAttribute("aria-valuetext", `y = ${y}`);
  listGains(result.gains);
  if (result.reason) {
    byId("explorer-state").textContent = `No operating point: ${result.reason}`;
    for (const id of ["margins", "poles", "machine", "bode-gain", "bode-phase", "step", "z-plane", "s-plane"]) byId(id).replaceChildren();
    return;
  }
  const { margins, modes, operatingPoint, stable } = result;
  byId("explorer-state").textContent =
    `${stable ? "Stable" : "UNSTABLE"} at x = ${x}, y = ${y}: Ms ${short(margins.Ms)} (limit ${short(data.limits.Ms)}), ` +
    `Mt ${short(margins.Mt)} (limit ${short(data.limits.Mt)}).`;
  list("margins", MARGINS.map(([name, label, factor, unit]) => [label, margins[name], factor, unit]));
  list("machine", [
    ["speed v", operatingPoint.v, 1, "m/s"], ["pressure a", operatingPoint.p_a, 1e-5, "bar"], ["pressure b", operatingPoint.p_b, 1e-5, "bar"],
    ["natural frequency", modes.natural, HERTZ, "Hz"], ["damping ratio", modes.damping, 1, ""], ["zero", modes.zero, 1, "rad/s"],
    ...modes.poles.map((pole, k) => [`pole ${k + 1}`, pole, 1, "rad/s"]),
  ]);
  list("poles", result.poles.map((pole, k) => [`pole ${k + 1}`, pole, 1, ""]));
  drawBode(result);
  drawStep(result);
  drawPlanes(result);
}

function listGains(gains) {
  const used = GAIN_NAMES.filter((name) => name in gains);
  list("gains", used.map((name) => [name.replace("_", " "), gains[name], 1, data.units[name]]));
}

// Rows of [name, value in SI, factor for display, unit] into a table body; a complex value is a pair.
function list(id, rows) {
  byId(id).replaceChildren(...rows.map(([name, value, factor, unit]) => {
    const row = document.createElement("tr"), head = document.createElement("th"), cell = document.createElement("td");
    const number = document.createElement("data"), measure = document.createElement("td");
    head.scope = "row";
    head.textContent = name;
    cell.className = "number";
    number.value = String(value);
    number.textContent = Array.isArray(value) ? complexText(value, factor) : short(value * factor);
    cell.append(number);
    measure.textContent = unit;
    row.append(head, cell, measure);
    return row;
  }));
}

function complexText([re, im], factor) {
  const text = short(re * factor);
  return im === 0 ? text : `${text} ${im < 0 ? "−" : "+"} ${short(Math.abs(im) * factor)}j`;
}

function drawBode({ omega, L, gainCrossings, phaseCrossings, margins, x, y }) {
  const hertz = omega.map((value) => value * HERTZ), decibels = (value) => 20 * Math.log10(modulus(value));
  const phase = unwrapped(L.map(([re, im]) => Math.atan2(im, re) * DEGREES));
  const range = [hertz[0], hertz[hertz.length - 1]], frequency = { label: "frequency (Hz)", range, log: true };
  const sensitivity = L.map((value) => -decibels(plus([1, 0], value)));
  const marks = (found, kind, className, of) => ({ kind, className, points: found.map((crossing) => [crossing.omega * HERTZ, of(crossing)]) });
  const nearest = ({ omega: at }) => phase[omega.findIndex((value) => value >= at)];
  const line = (values, className) => ({ kind: "line", points: paired(hertz, values), className });
  const level = (value) => ({ kind: "line", points: [[range[0], value], [range[1], value]], className: "limit" });
  const gain = L.map(decibels), limit = 20 * Math.log10(data.limits.Ms);
  drawChart(byId("bode-gain"), {
    x: { ...frequency, label: "" },
    y: { label: "gain (dB)", range: [Math.max(-80, rangeOf(gain)[0]), rangeOf([...gain, 10])[1]] },
    series: [level(limit), line(gain, "a"), line(sensitivity, "b"),
      marks(gainCrossings, "dots", "a", () => 0), marks(phaseCrossings, "squares", "b", (crossing) => decibels(crossing.L))],
    description: `Gain of the open loop at x = ${short(x)}, y = ${short(y)} m: crossover ${short(margins.crossover * HERTZ)} Hz, ` +
      `gain margin ${short(margins.gain_margin)}, Ms ${short(margins.Ms)}; the dashed level is the limit of Ms`,
  });
  drawChart(byId("bode-phase"), {
    x: frequency,
    y: { label: "phase of L (degrees)", range: rangeOf([...phase, -180]), steps: [30, 45, 90, 180, 360, 720, 1440] },
    series: [level(-180), line(phase, "a"), marks(gainCrossings, "dots", "a", nearest), marks(phaseCrossings, "squares", "b", nearest)],
    description: `Phase of the open loop: phase margin ${short(margins.phase_margin * DEGREES)} degrees`,
  });
}

// Degrees without jumps of 360.
function unwrapped(degrees) {
  let turns = 0;
  return degrees.map((value, k) => {
    if (k > 0) turns -= 360 * Math.round((value - degrees[k - 1]) / 360);
    return value + turns;
  });
}

function drawStep({ step, x, y }) {
  const t = step.map((_, k) => 1e3 * data.Ts * k), end = t[t.length - 1];
  drawChart(byId("step"), {
    x: { label: "time (ms)", range: [0, end] },
    y: { label: data.loop === "velocity" ? "v over reference (1)" : "y over reference (1)", range: rangeOf([0, 1, ...step]) },
    series: [{ kind: "line", points: [[0, 1], [end, 1]], className: "reference" }, { kind: "steps", points: paired(t, step), className: "a" }],
    description: `Step response of the linear loop at x = ${short(x)}, y = ${short(y)} m: largest value ${short(Math.max(...step))}`,
  });
}

function drawPlanes({ poles, openPoles, modes, stable }) {
  const circle = Array.from({ length: 181 }, (_, k) => [Math.cos((k * Math.PI) / 90), Math.sin((k * Math.PI) / 90)]);
  drawChart(byId("z-plane"), {
    x: { label: "real part of z (1)", range: [-1.2, 1.2] },
    y: { label: "imaginary part of z (1)", range: [-1.2, 1.2] },
    series: [{ kind: "line", points: circle, className: "circle" },
      { kind: "squares", points: poles, className: "b" }, { kind: "crosses", points: openPoles, className: "a" }],
    square: true,
    description: `Poles in the z-plane, ${stable ? "all" : "not all"} inside the unit circle; the largest has modulus ${short(modulus(poles[0]))}`,
  });
  drawChart(byId("s-plane"), {
    x: { label: "real part (rad/s)", range: rangeOf([0, modes.zero, ...modes.poles.map(([re]) => re)], 0.1) },
    y: { label: "imaginary part (rad/s)", range: rangeOf([0, ...modes.poles.map(([, im]) => im)], 0.1) },
    series: [{ kind: "crosses", points: modes.poles, className: "a" }, { kind: "rings", points: [[modes.zero, 0]], className: "b solid" }],
    description: `Poles ${modes.poles.map((pole) => complexText(pole, 1)).join(", ")} and zero ${short(modes.zero)} of v/x in rad/s`,
  });
}

function start() {
  byId("opening").max = data.openings.length - 1;
  fillSelect(byId("plant"), data.plants.map(({ label }) => label));
  fillSelect(byId("regulator"), data.regulators.map(({ label }) => label));
  fillSelect(byId("map-layer"), page.map.layers.map(({ label, unit }) => (unit === "1" ? label : `${label} (${unit})`)));
  fillSelect(byId("scenario"), page.traces.map(({ name }) => name));
  byId("opening").value = Math.floor(data.openings.length / 2 + 10);
  byId("position").value = POSITIONS / 2;
  const map = () => drawMap(page.map, Number(byId("map-layer").value), (x, y) => show(x, y));
  const motions = () => drawMotions(page.traces[Number(byId("scenario").value)]);
  for (const id of ["opening", "position", "plant", "regulator"]) byId(id).addEventListener("input", refresh);
  byId("map-layer").addEventListener("input", map);
  byId("scenario").addEventListener("input", motions);
  for (const button of document.querySelectorAll("button.show")) {
    button.addEventListener("click", () => show(Number(button.dataset.x), Number(button.dataset.y), button.dataset.plant));
  }
  const all = () => { widths.clear(); map(); motions(); refresh(); };
  addEventListener("resize", all);
  addEventListener("beforeprint", all);
  all();
}

start();
