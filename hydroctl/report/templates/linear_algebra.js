// Small dense linear algebra. A matrix is an array of rows, a complex number a pair [re, im].
// A system is { A, B, C, D } of z[k+1] = A z + B u, out = C z + D u.

function zeros(rows, columns) {
  return Array.from({ length: rows }, () => new Array(columns).fill(0));
}

function identity(n) {
  return Array.from({ length: n }, (_, i) => Array.from({ length: n }, (_, j) => (i === j ? 1 : 0)));
}

function map(A, change) {
  return A.map((row, i) => row.map((value, j) => change(value, i, j)));
}

function add(A, B) {
  return map(A, (value, i, j) => value + B[i][j]);
}

function multiply(A, B) {
  const columns = B.length ? B[0].length : 0;
  return A.map((row) => {
    const result = new Array(columns).fill(0);
    row.forEach((value, k) => {
      if (value !== 0) for (let j = 0; j < columns; j++) result[j] += value * B[k][j];
    });
    return result;
  });
}

// [[a, b], [c, d]] from blocks; a block may have no rows or no columns.
function block(a, b, c, d) {
  return [...a.map((row, i) => [...row, ...b[i]]), ...c.map((row, i) => [...row, ...d[i]])];
}

// exp(A) by its series, after halving A until the series converges fast, and squaring back.
function exponential(A) {
  const norm = Math.max(...A.map((row) => row.reduce((sum, value) => sum + Math.abs(value), 0)));
  const halvings = Math.max(0, Math.ceil(Math.log2(norm / 0.25)));
  const small = map(A, (value) => value / 2 ** halvings);
  let term = identity(A.length);
  let result = term;
  for (let k = 1; k <= 14; k++) {
    term = map(multiply(term, small), (value) => value / k);
    result = add(result, term);
  }
  for (let k = 0; k < halvings; k++) result = multiply(result, result);
  return result;
}

// The same system without states that nothing reads or drives; two that act in the same way are one.
function minimal(system) {
  const { A, B, C } = system, n = A.length, others = (k) => [...Array(n).keys()].filter((i) => i !== k);
  const acting = A.map((_, k) => [...A, ...C].map((row) => row[k]));
  for (let k = 0; k < n; k++) {
    const unread = others(k).every((i) => A[i][k] === 0) && C.every((row) => row[k] === 0);
    const undriven = others(k).every((j) => A[k][j] === 0) && B[k].every((value) => value === 0);
    if (unread || undriven) return minimal(without(system, k));
    for (const j of others(k)) {
      const size = Math.max(...acting[j].map(Math.abs)), place = acting[j].findIndex((value) => Math.abs(value) === size);
      const share = acting[k][place] / acting[j][place];
      if (acting[j].some((value, i) => Math.abs(acting[k][i] - share * value) > 1e-14 * Math.abs(share) * size)) continue;
      const joined = (rows) => rows.map((row, i) => (i === j ? row.map((value, m) => value + share * rows[k][m]) : row));
      return minimal(without({ ...system, A: joined(A), B: joined(B) }, k));
    }
  }
  return system;
}

// The system without its state number `k`.
function without({ A, B, C, D }, k) {
  const kept = (values) => values.filter((_, i) => i !== k);
  return { A: kept(A).map(kept), B: kept(B), C: C.map(kept), D };
}

// The same system with its states scaled by powers of two until rows and columns of A are of like size (Parlett and Reinsch).
function balanced({ A, B, C, D }) {
  const n = A.length, scale = new Array(n).fill(1);
  const a = map(A, (value) => value);
  for (let settled = false; !settled; ) {
    settled = true;
    for (let i = 0; i < n; i++) {
      let row = 0, column = 0;
      for (let j = 0; j < n; j++) if (j !== i) { row += Math.abs(a[i][j]); column += Math.abs(a[j][i]); }
      if (row === 0 || column === 0) continue;
      const factor = 2 ** Math.round(Math.log2(row / column) / 2);
      if (column * factor + row / factor >= 0.95 * (column + row)) continue;
      settled = false;
      scale[i] *= factor;
      for (let j = 0; j < n; j++) a[i][j] /= factor;
      for (let j = 0; j < n; j++) a[j][i] *= factor;
    }
  }
  return { A: a, B: map(B, (value, i) => value / scale[i]), C: map(C, (value, _, j) => value * scale[j]), D };
}

// The same system with A in upper Hessenberg form, by Gaussian elimination with interchanges.
function hessenberg({ A, B, C, D }) {
  const n = A.length;
  const [a, b, c] = [A, B, C].map((M) => map(M, (value) => value));
  for (let m = 1; m < n - 1; m++) {
    let pivot = m;
    for (let i = m + 1; i < n; i++) if (Math.abs(a[i][m - 1]) > Math.abs(a[pivot][m - 1])) pivot = i;
    if (a[pivot][m - 1] === 0) continue;
    if (pivot !== m) {
      [a[pivot], a[m]] = [a[m], a[pivot]];
      [b[pivot], b[m]] = [b[m], b[pivot]];
      for (const row of [...a, ...c]) [row[pivot], row[m]] = [row[m], row[pivot]];
    }
    for (let i = m + 1; i < n; i++) {
      const factor = a[i][m - 1] / a[m][m - 1];
      if (factor === 0) continue;
      for (let j = 0; j < n; j++) a[i][j] -= factor * a[m][j];
      for (let j = 0; j < b[i].length; j++) b[i][j] -= factor * b[m][j];
      for (const row of [...a, ...c]) row[m] += factor * row[i];
      a[i][m - 1] = 0;
    }
  }
  return { A: a, B: b, C: c, D };
}

// The function z -> C (z I - A)^-1 B, for complex z, of a system with one input and one output: elimination on the Hessenberg form,
// in arrays of n rows of n + 1 columns that are kept from call to call.
function frequencyResponse(system) {
  const { A, B, C } = hessenberg(balanced(system)), n = A.length, wide = n + 1;
  const negative = Float64Array.from(A.flatMap((row, i) => [...row.map((value) => -value), B[i][0]]));
  const re = new Float64Array(n * wide), im = new Float64Array(n * wide);
  return ([zr, zi]) => {
    re.set(negative);
    im.fill(0);
    for (let i = 0; i < n; i++) { re[i * wide + i] += zr; im[i * wide + i] = zi; }
    for (let k = 0; k < n - 1; k++) {
      const top = k * wide, low = top + wide;
      if (Math.abs(re[low + k]) + Math.abs(im[low + k]) > Math.abs(re[top + k]) + Math.abs(im[top + k])) {
        for (let j = k; j <= n; j++) {
          const r = re[top + j], m = im[top + j];
          re[top + j] = re[low + j]; im[top + j] = im[low + j];
          re[low + j] = r; im[low + j] = m;
        }
      }
      if (re[low + k] === 0 && im[low + k] === 0) continue;
      const square = re[top + k] * re[top + k] + im[top + k] * im[top + k];
      const fr = (re[low + k] * re[top + k] + im[low + k] * im[top + k]) / square;
      const fi = (im[low + k] * re[top + k] - re[low + k] * im[top + k]) / square;
      for (let j = k + 1; j <= n; j++) {
        re[low + j] -= fr * re[top + j] - fi * im[top + j];
        im[low + j] -= fr * im[top + j] + fi * re[top + j];
      }
    }
    return backSubstituted(re, im, C[0], n);
  };
}

// The sum of `weights` times the solution of the triangular equations; the right side is the last column, which it overwrites.
function backSubstituted(re, im, weights, n) {
  const wide = n + 1;
  let real = 0, imaginary = 0;
  for (let i = n - 1; i >= 0; i--) {
    const row = i * wide;
    let r = re[row + n], m = im[row + n];
    for (let j = i + 1; j < n; j++) {
      const sr = re[j * wide + n], si = im[j * wide + n];
      r -= re[row + j] * sr - im[row + j] * si;
      m -= re[row + j] * si + im[row + j] * sr;
    }
    const dr = re[row + i], di = im[row + i], square = dr * dr + di * di;
    const solved = (r * dr + m * di) / square, other = (m * dr - r * di) / square;
    re[row + n] = solved;
    im[row + n] = other;
    real += weights[i] * solved;
    imaginary += weights[i] * other;
  }
  return [real, imaginary];
}

// Eigenvalues of a real matrix, largest modulus first: shifted QR steps on the balanced Hessenberg form.
function eigenvalues(A) {
  const n = A.length;
  const none = { B: zeros(n, 0), C: [], D: [] };
  const h = map(hessenberg(balanced({ A, ...none })).A, (value) => [value, 0]);
  const found = [];
  for (let high = n - 1, steps = 0; high >= 0; steps++) {
    let low = high;
    while (low > 0 && modulus(h[low][low - 1]) > Number.EPSILON * (modulus(h[low][low]) + modulus(h[low - 1][low - 1]))) low--;
    if (low === high) {
      found.push(h[high][high]);
      high--;
      steps = 0;
    } else {
      if (steps > 300) throw new Error("the eigenvalues did not converge");
      const stalled = steps % 10 === 9;
      qrStep(h, low, high, stalled ? [modulus(h[high][high - 1]), modulus(h[high][high])] : shift(h, high));
    }
  }
  const rounding = 1e-12 * Math.max(...found.map(modulus));
  const clean = found.map(([re, im]) => [re, Math.abs(im) <= rounding ? 0 : im]);
  const order = (a, b) => (Math.abs(modulus(b) - modulus(a)) > rounding ? modulus(b) - modulus(a) : b[1] - a[1]);
  return clean.sort(order);
}

// The eigenvalue of the last 2 x 2 block that is nearest its last entry.
function shift(h, k) {
  const [a, b, c, d] = [h[k - 1][k - 1], h[k - 1][k], h[k][k - 1], h[k][k]];
  const half = scaled(minus(a, d), 0.5);
  let root = squareRoot(plus(times(half, half), times(b, c)));
  if (half[0] * root[0] + half[1] * root[1] < 0) root = scaled(root, -1);
  const sum = plus(half, root);
  return modulus(sum) === 0 ? d : minus(d, divide(times(b, c), sum));
}

// One step H - s I = Q R, H = R Q + s I on rows and columns low ... high, by Givens rotations.
function qrStep(h, low, high, s) {
  const rotations = [];
  for (let k = low; k <= high; k++) h[k][k] = minus(h[k][k], s);
  for (let k = low; k < high; k++) {
    const size = Math.hypot(...h[k][k], ...h[k + 1][k]);
    const u = size === 0 ? [1, 0] : scaled(h[k][k], 1 / size), v = size === 0 ? [0, 0] : scaled(h[k + 1][k], 1 / size);
    rotations.push([u, v]);
    for (let j = k; j <= high; j++) {
      const [above, below] = [h[k][j], h[k + 1][j]];
      h[k][j] = plus(times(conjugate(u), above), times(conjugate(v), below));
      h[k + 1][j] = minus(times(u, below), times(v, above));
    }
  }
  rotations.forEach(([u, v], index) => {
    const k = low + index;
    for (let i = low; i <= Math.min(k + 1, high); i++) {
      const [left, right] = [h[i][k], h[i][k + 1]];
      h[i][k] = plus(times(u, left), times(v, right));
      h[i][k + 1] = minus(times(conjugate(u), right), times(conjugate(v), left));
    }
  });
  for (let k = low; k <= high; k++) h[k][k] = plus(h[k][k], s);
}

function plus(a, b) { return [a[0] + b[0], a[1] + b[1]]; }
function minus(a, b) { return [a[0] - b[0], a[1] - b[1]]; }
function times(a, b) { return [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]; }
function scaled(a, factor) { return [a[0] * factor, a[1] * factor]; }
function conjugate(a) { return [a[0], -a[1]]; }
function modulus(a) { return Math.hypot(a[0], a[1]); }
function divide(a, b) {
  const square = b[0] * b[0] + b[1] * b[1];
  return [(a[0] * b[0] + a[1] * b[1]) / square, (a[1] * b[0] - a[0] * b[1]) / square];
}
function squareRoot(a) {
  const size = modulus(a), real = Math.sqrt((size + Math.abs(a[0])) / 2);
  if (real === 0) return [0, 0];
  const other = Math.abs(a[1]) / (2 * real);
  return a[0] >= 0 ? [real, Math.sign(a[1]) * other] : [other, (a[1] < 0 ? -1 : 1) * real];
}
