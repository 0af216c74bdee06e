// The operating map and the motions of the validation.

const RAMP = [[0, 34, 78], [52, 69, 110], [101, 105, 112], [149, 142, 114], [202, 184, 98], [253, 231, 55]];
const LOOKS = ["a", "b", "c", "d", "e"];

function byId(id) {
  return document.getElementById(id);
}

function fillSelect(select, labels) {
  select.replaceChildren(...labels.map((label, index) => new Option(label, index)));
}

function colour(fraction) {
  const at = Math.min(1, Math.max(0, fraction)) * (RAMP.length - 1), k = Math.min(RAMP.length - 2, Math.floor(at));
  return `rgb(${RAMP[k].map((value, j) => Math.round(value + (at - k) * (RAMP[k + 1][j] - value))).join(" ")})`;
}

// Draws one layer of the map; `choose(x, y)` is called for a clicked cell.
function drawMap({ x, y, layers }, index, choose) {
  const { label, unit, worst, values } = layers[index], svg = byId("map-figure");
  const width = widthOf(svg), height = 330;
  const frame = { left: 68, right: width - 84, top: 8, bottom: height - 40 };
  const wide = (frame.right - frame.left) / y.length, tall = (frame.bottom - frame.top) / x.length;
  const measure = unit === "1" ? "" : ` ${unit}`;
  const finite = values.flat().filter((value) => value !== null);
  const [low, high] = [Math.min(...finite), Math.max(...finite)];
  const fraction = (value) => (high > low ? (value - low) / (high - low) : 0.5);
  const cells = values.flatMap((row, i) => row.map((value, j) => {
    const place = { x: frame.left + j * wide, y: frame.bottom - (i + 1) * tall, width: wide + 0.3, height: tall + 0.3 };
    const text = value === null ? "none" : short(value) + measure;
    const title = element("title", {}, `${label} ${text} at x = ${short(x[i])}, y = ${short(y[j])} m`);
    const cell = element("rect", { ...place, fill: value === null ? "#888" : colour(fraction(value)), class: "cell" }, title);
    cell.addEventListener("click", () => choose(x[i], y[j]));
    return cell;
  }));
  const end = worst === "max" ? high : low;
  const [i, j] = worst ? indexOf(values, end) : [-1, -1];
  const star = worst ? [element("circle", { cx: frame.left + (j + 0.5) * wide, cy: frame.bottom - (i + 0.5) * tall, r: 7, class: "star" })] : [];
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  const span = `from ${short(low)} to ${short(high)}${measure}`;
  const where = worst ? `; the worst is ${short(end)} at x = ${short(x[i])}, y = ${short(y[j])} m (ringed)` : "";
  svg.setAttribute("aria-label", `Map of ${label} over valve opening and position, ${span}${where}`);
  byId("map-caption").textContent = `${label}: ${span}${where}.`;
  svg.replaceChildren(...cells, ...star, ...counts(x, y, frame, wide, tall), ...ramp(frame, low, high, unit));
}

function indexOf(values, wanted) {
  const i = values.findIndex((row) => row.includes(wanted));
  return [i, values[i].indexOf(wanted)];
}

// The labels of rows and columns, as many as fit.
function counts(x, y, frame, wide, tall) {
  const every = (count, room, size) => Math.ceil((count * size) / room);
  const rows = every(x.length, frame.bottom - frame.top, 15), columns = every(y.length, frame.right - frame.left, 44);
  const middle = (frame.top + frame.bottom) / 2;
  return [
    ...x.flatMap((value, i) => (i % rows ? [] : [element("text", { x: frame.left - 5, y: frame.bottom - (i + 0.5) * tall + 4, class: "tick end" }, short(value, 3))])),
    ...y.flatMap((value, j) => (j % columns ? [] : [element("text", { x: frame.left + (j + 0.5) * wide, y: frame.bottom + 15, class: "tick middle" }, short(value, 3))])),
    element("text", { x: 12, y: middle, class: "label middle", transform: `rotate(-90 12 ${middle})` }, "valve opening x (of full)"),
    element("text", { x: (frame.left + frame.right) / 2, y: frame.bottom + 33, class: "label middle" }, "position y (m)"),
  ];
}

function ramp(frame, low, high, unit) {
  const left = frame.right + 12, steps = 40, tall = (frame.bottom - frame.top) / steps;
  const bar = Array.from({ length: steps }, (_, k) =>
    element("rect", { x: left, y: frame.bottom - (k + 1) * tall, width: 14, height: tall + 0.4, fill: colour(k / (steps - 1)) }));
  const text = (y, value) => element("text", { x: left + 18, y, class: "tick" }, short(value, 3));
  const middle = (frame.top + frame.bottom) / 2;
  return [
    ...bar, text(frame.top + 10, high), text(middle + 4, (low + high) / 2), text(frame.bottom, low),
    element("text", { x: left + 7, y: frame.bottom + 15, class: "tick middle" }, unit === "1" ? "" : unit),
  ];
}

const SIGNALS = [
  ["y", "position y (m)"], ["v", "speed v (m/s)"], ["x", "valve opening x (of full)"],
  ["p_a", "pressure a (bar)"], ["p_b", "pressure b (bar)"],
];

// Draws all signals of one scenario, every regulator's motion over the others.
function drawMotions(scenario) {
  const reference = decoded(scenario.reference, Float32Array);
  const t = Array.from(reference, (_, k) => k * scenario.step);
  const shown = scenario.motions.filter((motion) => !motion.reason);
  byId("motion-key").replaceChildren(
    keyPart("reference", "reference"),
    ...scenario.motions.map((motion, k) => keyPart(LOOKS[k % LOOKS.length], motion.reason ? `${motion.label}: ${motion.reason}` : motion.label)),
  );
  byId("motion-figures").replaceChildren(...SIGNALS.map(([name]) => {
    const figure = document.createElement("div"), svg = element("svg", { id: `motion-${name}`, role: "img" });
    figure.className = "figure";
    figure.append(svg);
    return figure;
  }));
  for (const [name, label] of SIGNALS) {
    const controlled = name === (scenario.loop === "position" ? "y" : "v");
    const series = shown.map((motion) => ({
      kind: name === "x" ? "steps" : "line",
      points: paired(t, decoded(motion[name], Float32Array)),
      className: LOOKS[scenario.motions.indexOf(motion) % LOOKS.length],
    }));
    if (controlled) series.unshift({ kind: "steps", points: paired(t, reference), className: "reference" });
    const values = series.flatMap(({ points }) => points.map(([, value]) => value));
    drawChart(byId(`motion-${name}`), {
      x: { label: "time (s)", range: [0, t[t.length - 1]] },
      y: { label, range: rangeOf(values) },
      series,
      height: 210,
      description: `${label} over time in the scenario ${scenario.name}`,
    });
  }
}

function keyPart(className, text) {
  const part = document.createElement("span");
  part.className = className;
  part.textContent = text;
  return part;
}
