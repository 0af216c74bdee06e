// Line charts as SVG: axes with units, a grid, series and marks. Colours come from the style sheet by class.

const SVG = "http://www.w3.org/2000/svg";
const ROOM = { left: 58, right: 12, top: 10, bottom: 38 };

function element(name, attributes, ...children) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

// The width that a figure has on the page, measured once: asking again after every drawing makes the browser lay out the page anew.
const widths = new Map();

function widthOf(svg) {
  if (!widths.has(svg.id)) widths.set(svg.id, Math.max(240, svg.parentElement.clientWidth || 480));
  return widths.get(svg.id);
}

// Draws into `svg`. x, y: { label, range: [low, high], log, steps }, `steps` between ticks to choose from. series: { kind, points: [[x, y], ...], className }.
function drawChart(svg, { x, y, series, height = 250, square = false, description }) {
  const width = widthOf(svg);
  const tall = square ? Math.min(width, 380) : height;
  const frame = { left: ROOM.left, right: width - ROOM.right, top: ROOM.top, bottom: tall - ROOM.bottom };
  const toX = scale(x, square ? widened(x, y, frame) : x.range, frame.left, frame.right);
  const toY = scale(y, y.range, frame.bottom, frame.top);
  svg.setAttribute("viewBox", `0 0 ${width} ${tall}`);
  svg.setAttribute("aria-label", description);
  const clip = `${svg.id}-frame`;
  const box = { x: frame.left, y: frame.top, width: frame.right - frame.left, height: frame.bottom - frame.top };
  svg.replaceChildren(
    element("clipPath", { id: clip }, element("rect", box)),
    ...axis(x, toX, frame, false, width),
    ...axis(y, toY, frame, true, width),
    element("rect", { ...box, class: "frame" }),
    element("g", { "clip-path": `url(#${clip})` }, ...series.flatMap((one) => drawn(one, toX, toY))),
  );
}

// A function from values to pixels.
function scale({ log }, [low, high], from, to) {
  const of = log ? Math.log10 : (value) => value;
  const first = of(low), span = of(high) - first || 1;
  const convert = (value) => from + ((of(value) - first) / span) * (to - from);
  return Object.assign(convert, { low, high });
}

// The range of x that gives both axes the same scale.
function widened(x, y, frame) {
  const middle = (x.range[0] + x.range[1]) / 2;
  const half = ((y.range[1] - y.range[0]) * (frame.right - frame.left)) / (frame.bottom - frame.top) / 2;
  return [middle - half, middle + half];
}

function axis({ label, log, steps }, convert, frame, vertical, width) {
  const { left, right, top, bottom } = frame, made = [];
  const count = vertical ? 5 : Math.max(3, Math.round(width / 90));
  for (const tick of log ? decades(convert) : ticks(convert, count, steps)) {
    const at = convert(tick), text = log ? power(tick) : short(tick);
    made.push(
      vertical
        ? element("line", { x1: left, x2: right, y1: at, y2: at, class: "grid" })
        : element("line", { x1: at, x2: at, y1: top, y2: bottom, class: "grid" }),
      vertical
        ? element("text", { x: left - 5, y: at + 4, class: "tick end" }, text)
        : element("text", { x: at, y: bottom + 15, class: "tick middle" }, text),
    );
  }
  const middle = (top + bottom) / 2;
  made.push(
    vertical
      ? element("text", { x: 12, y: middle, class: "label middle", transform: `rotate(-90 12 ${middle})` }, label)
      : element("text", { x: (left + right) / 2, y: bottom + 33, class: "label middle" }, label),
  );
  return made;
}

function ticks({ low, high }, count, steps) {
  const rough = (high - low) / count, unit = 10 ** Math.floor(Math.log10(rough));
  const step = (steps ?? [1, 2, 5, 10].map((factor) => factor * unit)).find((size) => size >= rough * 0.999);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return found;
}

function decades({ low, high }) {
  const found = [];
  for (let k = Math.ceil(Math.log10(low)); k <= Math.log10(high); k++) found.push(10 ** k);
  return found;
}

function power(value) {
  return value >= 0.01 && value <= 10000 ? String(Number(value.toPrecision(1))) : `1e${Math.round(Math.log10(value))}`;
}

// A number in at most `digits` digits.
function short(value, digits = 4) {
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "–";
  if (Math.abs(value) < 1e-12) return "0";
  return String(Number(value.toPrecision(digits))).replace("-", "−");
}

function drawn({ kind, points, className }, toX, toY) {
  const at = points.filter(([x, y]) => Number.isFinite(x) && Number.isFinite(y)).map(([x, y]) => [toX(x), toY(y)]);
  const name = `series ${className}`;
  if (kind === "crosses") return at.map(([x, y]) => element("path", { d: `M${x - 4} ${y - 4}l8 8m-8 0l8 -8`, class: name }));
  if (kind === "rings") return at.map(([x, y]) => element("circle", { cx: x, cy: y, r: 5, class: name }));
  if (kind === "squares") return at.map(([x, y]) => element("rect", { x: x - 3.5, y: y - 3.5, width: 7, height: 7, class: `${name} filled` }));
  if (kind === "dots") return at.map(([x, y]) => element("circle", { cx: x, cy: y, r: 4, class: `${name} filled` }));
  const rounded = at.map(([x, y]) => [x.toFixed(1), y.toFixed(1)]);
  const path = rounded.map(([x, y], k) => (k === 0 ? `M${x} ${y}` : kind === "steps" ? `H${x}V${y}` : `L${x} ${y}`)).join("");
  return [element("path", { d: path, class: name })];
}

// The least and the largest of the finite values, with room around.
function rangeOf(values, room = 0.06) {
  const finite = values.filter(Number.isFinite);
  let [low, high] = finite.reduce(([a, b], value) => [Math.min(a, value), Math.max(b, value)], [Infinity, -Infinity]);
  if (!(high > low)) [low, high] = finite.length ? [low - Math.max(1e-3, 0.1 * Math.abs(low)), low + Math.max(1e-3, 0.1 * Math.abs(low))] : [0, 1];
  return [low - room * (high - low), high + room * (high - low)];
}

function paired(xs, ys) {
  return Array.from(xs, (x, k) => [x, ys[k]]);
}
