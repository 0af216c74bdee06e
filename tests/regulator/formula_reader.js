// Runs a schedule by the formulas that it carries. Nothing of the law stands here: this reader knows only how to evaluate
// statements in their order, and what to do with a sensor that fails.
"use strict";

const { sqrt, tan } = Math;

// One function of all statements: names to values, then the memory and the output.
function compiled(law, part, extra) {
  const names = [...law.constants, ...law.arrays, ...law.memory, ...law.inputs].map((one) => one.name);
  const lines = part.statements.map((one) => `const ${one.name} = ${one.expression};`);
  const memory = Object.entries(part.memory).map(([name, expression]) => `${name}: ${expression}`);
  const body = `${lines.join("\n")}\nreturn { memory: { ${memory.join(", ")} }, output: ${part.output}, seen: (name) => eval(name) };`;
  return new Function("sqrt", "tan", ...names, ...extra, body);
}

// A regulator with step(start, inputs): the command, and the gains that were looked up.
function regulatorOf(law) {
  const sample = compiled(law, law.sample, []), start = compiled(law, law.start, ["start_x"]);
  const fixed = [...law.constants.map((one) => one.value), ...law.arrays.map((one) => one.values)];
  const initial = Object.fromEntries(law.memory.map((one) => [one.name, one.rest]));
  const isFinite = (values) => Object.values(values).every(Number.isFinite);
  let memory = initial;
  return function step(startX, given) {
    const inputs = law.inputs.map((one) => given[one.name]);
    const run = (part, ...extra) => {
      const made = part(sqrt, tan, ...fixed, ...law.memory.map((one) => memory[one.name]), ...inputs, ...extra);
      memory = made.memory;
      return made;
    };
    if (!inputs.every(Number.isFinite)) {
      memory = initial;
      return { x: 0, seen: () => null };
    }
    if (startX !== null) run(start, startX);
    const made = run(sample);
    if (!isFinite(memory)) memory = initial;
    return { x: memory.last_x, seen: made.seen };
  };
}

// The largest difference of x from that of the vectors {start, inputs, x}, and that of the gains relatively.
function largestDifference(law, vectors) {
  const step = regulatorOf(law);
  let largest = { x: 0, gains: 0 };
  for (const vector of vectors) {
    const found = step(vector.start, vector.inputs);
    largest.x = Math.max(largest.x, Math.abs(found.x - vector.x));
    for (const [name, value] of Object.entries(vector.gains || {})) {
      if (value !== 0) largest.gains = Math.max(largest.gains, Math.abs(found.seen(name) / value - 1));
    }
  }
  return largest;
}
