// Runs a schedule file by the formulas that it carries. Nothing of the law stands here: this reader knows only how to
// evaluate statements in their order, and what to do with a sensor that fails.
"use strict";

const { sqrt, tan } = Math;

const namesOf = (list) => list.map((one) => one.name);
const valuesOf = (list, key) => list.map((one) => one[key]);

// The values of an array of the law: its own, or those that stand elsewhere in the file.
const arrayIn = (file) => (array) => array.values ?? array.source.split(".").reduce((part, key) => part[key], file);

// A part of the law as one function of all names: the memory afterwards, and what else was computed.
function compiled(law, part, extra) {
  const lines = part.statements.map((one) => `const ${one.name} = ${one.expression};`);
  const memory = Object.entries(part.memory).map(([name, text]) => `${name}: ${text}`);
  const names = [...namesOf(law.constants), ...namesOf(law.arrays), ...namesOf(law.memory), ...namesOf(law.inputs)];
  const answer = `return { memory: { ${memory.join(", ")} }, output: ${part.output}, seen: (name) => eval(name) };`;
  return new Function("sqrt", "tan", ...names, ...extra, [...lines, answer].join("\n"));
}

// step(start, inputs by name): the command, and a function that gives what was computed under a name.
function regulatorIn(file) {
  const law = file.law, rest = Object.fromEntries(law.memory.map((one) => [one.name, one.rest]));
  const sample = compiled(law, law.sample, []), start = compiled(law, law.start, ["start_x"]);
  const fixed = [...valuesOf(law.constants, "value"), ...law.arrays.map(arrayIn(file))];
  let memory = rest;
  return function step(startX, inputs) {
    const read = namesOf(law.inputs).map((name) => inputs[name]);
    const run = (part, ...extra) => part(sqrt, tan, ...fixed, ...namesOf(law.memory).map((name) => memory[name]), ...read, ...extra);
    memory = read.every(Number.isFinite) ? memory : rest;
    if (!read.every(Number.isFinite)) return { x: law.fallback.x, seen: () => null };
    if (startX !== null) memory = run(start, startX).memory;
    const made = run(sample);
    memory = Object.values(made.memory).every(Number.isFinite) ? made.memory : rest;
    return { x: memory === rest ? law.fallback.x : made.output, seen: made.seen };
  };
}

// The largest difference from the test vectors of the file: of x, and of the gains relatively.
function largestDifference(file) {
  const step = regulatorIn(file), { columns, rows } = file.test_vectors;
  const largest = { x: 0, gains: 0 };
  for (const row of rows) {
    const given = Object.fromEntries(columns.map((name, k) => [name, row[k]]));
    const found = step(given.start, given);
    largest.x = Math.max(largest.x, Math.abs(found.x - given.x));
    for (const name of Object.keys(file.scheduling.tables).filter((name) => given[name])) {
      largest.gains = Math.max(largest.gains, Math.abs(found.seen(name) / given[name] - 1));
    }
  }
  return largest;
}
