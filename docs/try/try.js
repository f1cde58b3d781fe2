// Prediction errors of a log that is dropped on the page: physics model, hold, ARX, hybrid. Positions are in m or rad.
"use strict";

const UNITS = { // factor to m or rad; name of its errors' unit, and their factor
  m: [1, "µm", 1e6], mm: [1e-3, "µm", 1e6], um: [1e-6, "µm", 1e6], nm: [1e-9, "µm", 1e6], in: [0.0254, "µm", 1e6],
  rad: [1, "µrad", 1e6], mrad: [1e-3, "µrad", 1e6], urad: [1e-6, "µrad", 1e6],
  deg: [Math.PI / 180, "mdeg", 180e3 / Math.PI], rev: [2 * Math.PI, "mrev", 500 / Math.PI],
};
const ANGLES = ["rad", "mrad", "urad", "deg", "rev"];
const TIMES = { s: 1, ms: 1e-3, us: 1e-6, ns: 1e-9, min: 60 };
const SPELLINGS = { // as hybridsep/logs/units.py
  meter: "m", metre: "m", meters: "m", metres: "m", micron: "um", microns: "um", inch: "in", '"': "in", "°": "deg",
  degree: "deg", degrees: "deg", radian: "rad", radians: "rad", turn: "rev", turns: "rev", revolution: "rev",
  sec: "s", second: "s", seconds: "s", msec: "ms", usec: "us", millimeter: "mm", millimeters: "mm", millimetre: "mm",
  micrometer: "um", micrometre: "um", millisecond: "ms", milliseconds: "ms", microsecond: "us", microseconds: "us",
};
const SUFFIXES = ["mm", "um", "nm", "rad", "mrad", "urad", "deg", "s", "ms", "us", "ns"];
const THOUSANDS = /^[+-]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?$/;
const TURN = 2 * Math.PI;
const NAMES = { // in small letters, by precedence, as hybridsep/logs/names.py
  t: "t time timestamp time_stamp sec seconds zeit",
  x_d: "x_d xd x_ref xref x_cmd x_set x_des reference setpoint set_point command commanded " +
    "position_commanded commanded_position pos_cmd cmd_pos pos_ref pos_set ctrl_pos des_pos q_d " +
    "sollposition solllage lagesollwert",
  x: "x_meas x x_m x_act measured measurement actual position_measured measured_position actual_position " +
    "position_actual pos_meas pos_act act_pos enc_pos feedback q_meas process_value istposition " +
    "istlage lageistwert",
};
const DEAD_TIMES = 21; // samples: 0 to 20 are tried
const ARX_LAGS = [20, 40];
const FAR = 10; // largest distances from the start, beyond which a prediction diverges
const COLOURS = { "physics model": "#999", hold: "#e69f00", ARX20: "#cc79a7", ARX40: "#d55e00", hybrid: "#0b84d8" };
const at = (id) => document.getElementById(id);
/** Three digits, or a whole number. */
const digits = (one) => one.toFixed(Math.min(100, Math.max(0, 2 - Math.floor(Math.log10(one)))));
const pause = () => new Promise((done) => setTimeout(done));

/** What is wrong with a log, for the user. */
class LogError extends Error {}

/** Cells of a line, without blanks and quotation marks around them. */
function split(line, separator) {
  const cells = line.includes('"') ? line.match(new RegExp(`("[^"]*"|[^${separator}"])*(${separator}|$)`, "g")).slice(0, -1)
    .concat(line.endsWith(separator) ? [""] : []) : line.split(separator);
  return cells.map((cell) => cell.replace(new RegExp(`${separator}$`), "").trim().replace(/^["'](.*)["']$/, "$1").trim());
}

/** Whether only whole numbers below 1000 of a column lack a comma, and neighbours are closer if it is of thousands. */
function passes_1000(rows, j) {
  const written = rows.map((row) => row[j] ?? "").filter((cell) => cell && isFinite(cell.replaceAll(",", "")));
  const plain = written.filter((cell) => !cell.includes(","));
  if (!plain.length || plain.length === written.length || !plain.every((cell) => /^[+-]?\d{1,3}$/.test(cell))) return false;
  const [grouped, decimal] = ["", "."].map((mark) => written.map((cell) => +cell.replaceAll(",", mark)).reduce(
    (most, value, i, all) => (i ? Math.max(most, Math.abs(value - all[i - 1])) : most), 0));
  return grouped < decimal;
}

/** Whether points are between thousands in one of the columns, as in German, where nothing has a comma. */
function points_divide(rows, n) {
  const dotted = rows.map((row) => row.map((cell) => cell.replaceAll(".", ",")));
  return !rows.flat().some((cell) => cell.includes(",")) && [...Array(n).keys()].some((j) =>
    dotted.every((row) => !row[j]?.includes(",") || THOUSANDS.test(row[j])) && passes_1000(dotted, j));
}

/** Names, units and rows of texts of a CSV; what a comma in a number stands for, null where it is an error. */
function parse(text) {
  const lines = text.replace(/^\ufeff/, "").split(/\r?\n/).filter((line) => line.trim() && !/^\s*(#|%|\/\/|!)/.test(line));
  const separator = [";", "\t", ","].find((one) => lines[0]?.includes(one));
  const cells = separator ? lines.map((line) => split(line, separator)) : [[]];
  if (!separator || cells[0].every((cell) => !isNaN(cell.replace(",", "."))))
    throw new LogError("the first row must name the columns, such as t,x_d,x");
  const below = (cells[1] ?? []).map((cell) => cell.replace(/^[[(]|[\])]$/g, ""));
  const has_units = below.some(factor_of) && below.every((cell) => factor_of(cell) || ["", "-", "1"].includes(cell));
  const rows = cells.slice(has_units ? 2 : 1), written = rows.flat().filter((cell) =>
    cell && (isFinite(cell.replace(",", ".")) || THOUSANDS.test(cell)));
  if (points_divide(rows, cells[0].length)) throw new LogError("write numbers without separators of thousands");
  const commas = written.filter((cell) => cell.includes(",")), points = written.some((cell) => cell.includes("."));
  const thousands = commas.length && commas.every((cell) => THOUSANDS.test(cell)) &&
    (points || commas.some((cell) => cell.split(",").length > 2) || cells[0].some((_, j) => passes_1000(rows, j)));
  return { names: cells[0], units: has_units ? below : [], rows, comma: thousands ? "" : points ? null : "." };
}

/** Spelling of a unit as the tables have it; the factor of a unit to SI, if it is one of position or time. */
const spelled = (text) => (one => SPELLINGS[one] ?? one)(text.trim().toLowerCase().replace(/[µμ]/g, "u"));
const factor_of = (text) => UNITS[spelled(text)]?.[0] ?? TIMES[spelled(text)];

/** A name without its unit, and the unit as it is written: x [mm], x (mm), x / mm, x in mm, x, mm, x_mm or x mm. */
function stated(name) {
  const brackets = /^(.*?)\s*(?:\[([^[\]]*)\]|\(([^()]*)\))\s*$/.exec(name);
  if (brackets) {
    const [, before, square, round] = brackets, text = (square || round || "").trim();
    if (/^\d+$/.test(square ?? "") && name[before.length] === "[") return [name, ""];
    if (["", "-", "1"].includes(text)) return [before, ""];
    return square !== undefined || factor_of(text.split("/")[0]) ? [before, text] : [name, ""];
  }
  const slash = /^(.*?\S)\s*(?:\/|\bin\b)\s*(\S+)\s*$/.exec(name);
  if (slash && factor_of(slash[2])) return slash.slice(1);
  const suffix = /^(.*?[^_\s,])(?:_|\s*,\s*|\s+(?=[a-zµμ]{2,}$))([^_\s,]+)$/.exec(name);
  return suffix && SUFFIXES.includes(spelled(suffix[2])) ? suffix.slice(1) : [name, ""];
}
const plain = (name) => stated(name)[0].trim().toLowerCase().replace(/[\s.-]/g, "_");
const unit_of = (log, j) => log.units[j] || stated(log.names[j])[1];

function column({ names, rows, comma }, j, factor) {
  return Float64Array.from(rows, (row, i) => {
    const cell = row[j] ?? "", bad = cell.includes(",") && (comma === null || (comma === "" && !THOUSANDS.test(cell)));
    const number = cell.replaceAll(",", comma ?? "");
    if (bad || number === "" || !isFinite(number))
      throw new LogError(`row ${i + 1}, ${names[j]}: "${cell}" is no number; ` +
        (/\d[.,]\d/.test(cell) ? "write numbers without separators of thousands" : "hybridsep fit reads logs with gaps"));
    return factor * number;
  });
}

/** Sampling interval, s, of times in a unit, which is no guess: without one they must be plausible in seconds. */
function interval(times, name, unit) {
  const factor = unit ? TIMES[spelled(unit)] : 1;
  if (!factor) throw new LogError(`time '${name}' must be in one of ${Object.keys(TIMES).join(", ")}, its unit is '${unit}'`);
  const steps = times.slice(1).map((one, i) => factor * (one - times[i])), sorted = steps.slice().sort();
  const T_s = sorted[sorted.length >> 1], still = steps.filter((step) => !(step > 0)).length;
  if (still > 0.05 * steps.length)
    throw new LogError(`time '${name}' is rounded too coarsely, ${(100 * still / steps.length).toPrecision(3)} % of the ` +
      "times are not above the one before; choose no time, and say the interval between the rows");
  if (!unit && steps.length >= 9 && (T_s === 1 || !(T_s >= 2e-6 && T_s <= 0.5)))
    throw new LogError(`column '${name}' ${T_s === 1 ? "counts samples: it is an index, or a time in ms" :
      `has an interval of ${T_s.toPrecision(6)}, no axis's in s`}; choose no time, or name its unit in the file, '${name} [ms]'`);
  const wrong = steps.findIndex((step) => !(Math.abs(step - T_s) <= 0.5 * T_s));
  if (wrong < 0) return factor * (times[times.length - 1] - times[0]) / steps.length;
  const [here, usual] = [steps[wrong], T_s].map((one) => Number(one.toPrecision(4)));
  throw new LogError(`row ${wrong + 2}: the time changes by ${here} s, elsewhere by ${usual} s; cut the log there`);
}

const travel = (x) => x.reduce((a, b) => Math.max(a, b)) - x.reduce((a, b) => Math.min(a, b));

/** A position without the jumps of one that counts modulo a turn. */
function unwrapped(x) {
  if (travel(x) > 1.05 * TURN) return x;
  let turns = 0;
  return x.map((one, k) => {
    if (k && Math.abs(one - x[k - 1]) > TURN / 2) turns -= Math.round((one - x[k - 1]) / TURN);
    return one + turns * TURN;
  });
}

/** Samples of the chosen columns, in m or rad: {x_d, x, T_s, unit}; in `chosen.unit` what states none. */
function samples(log, chosen) {
  const names = [chosen.x_d, chosen.x].map((j) => spelled(unit_of(log, j) || chosen.unit));
  const wrong = names.findIndex((name) => !UNITS[name]);
  if (wrong >= 0)
    throw new LogError(`column '${log.names[[chosen.x_d, chosen.x][wrong]]}' must be a position in one of ` +
      `${Object.keys(UNITS).join(", ")}; its unit is '${names[wrong]}'`);
  if (ANGLES.includes(names[0]) !== ANGLES.includes(names[1]))
    throw new LogError(`commanded and measured position are in ${names.join(" and ")}; both must be lengths or both angles`);
  let [x_d, x] = [chosen.x_d, chosen.x].map((j, i) => column(log, j, UNITS[names[i]][0]));
  const still = [["commanded", x_d], ["measured", x]].filter(([, one]) => travel(one) === 0).map(([name]) => name);
  if (still.length)
    throw new LogError(`no motion: the ${still.join(" and the ")} position never change${still.length > 1 ? "" : "s"}: an ` +
      "axis at rest shows neither its model nor its errors");
  if (x.every((one, k) => one === x_d[k]))
    throw new LogError("same column: the measured position is the commanded one in every sample");
  if (ANGLES.includes(names[0])) {
    [x_d, x] = [x_d, x].map(unwrapped);
    const off = x.map((one, k) => one - x_d[k]).sort()[x.length >> 1], turns = TURN * Math.round(off / TURN);
    x = x.map((one) => one - turns);
  }
  const gain = travel(x) / travel(x_d);
  if (!(gain >= 0.1 && gain <= 5))
    throw new LogError(`scale: the measured position moves ${gain.toPrecision(4)} times as far as the commanded one; ` +
      "state the unit of each column in its name, such as 'x [mm]'");
  const t = chosen.t === "" ? null : column(log, chosen.t, 1);
  const T_s = t ? interval(t, log.names[chosen.t], unit_of(log, chosen.t)) : chosen.T_s;
  return { x_d, x, T_s, unit: UNITS[names[0]] };
}

/** The mode (ω² + βs) / (s² + 2ζωs + ω²) over a zero-order hold, from rest at the first command, with the β of least
 *  variance of the first n residuals: {f_n, zeta, beta, dead_time, misfit}. */
function fitted(f_n, zeta, dead_time, T_s, x_d, x, n) {
  if (!(f_n * T_s > 1e-5 && f_n * T_s < 0.45 && zeta > 0.02 && zeta < 20)) return { misfit: Infinity };
  const omega = 2 * Math.PI * f_n, s = zeta * omega, d = omega * Math.sqrt(Math.abs(zeta * zeta - 1)) || 1e-9;
  const [C, S] = zeta > 1 ? [Math.cosh(d * T_s), Math.sinh(d * T_s) / d] : [Math.cos(d * T_s), Math.sin(d * T_s) / d];
  const g = Math.exp(-s * T_s), a = g * (C + S * s), b = g * S, c = -b * omega * omega, e = g * (C - S * s);
  let sum = 0, sum_v = 0, ee = 0, ev = 0, vv = 0;
  for (let k = 0, y = 0, v = 0; k < n; k++) {
    const error = x[k] - x_d[0] - y, u = x_d[Math.max(k - dead_time, 0)] - x_d[0];
    sum += error; sum_v += v; ee += error * error; ev += error * v; vv += v * v;
    [y, v] = [u + a * (y - u) + b * v, c * (y - u) + e * v]; // exp(A T_s) = [a b; c e]
  }
  const covariance = ev - sum * sum_v / n, zero = covariance / (vv - sum_v * sum_v / n) || 0; // β / ω²
  return { f_n, zeta, beta: zero * omega * omega, dead_time, misfit: ee - sum * sum / n - zero * covariance };
}

/** The mode of least misfit: for each dead time a search over ln f_n and ln ζ from three beginnings. */
async function identify(T_s, x_d, x, n) {
  let best = { misfit: Infinity };
  for (let dead_time = 0; dead_time < DEAD_TIMES; dead_time++) {
    for (const f of [0.005, 0.02, 0.08]) {
      let found = fitted(f / T_s, 0.7, dead_time, T_s, x_d, x, n);
      for (let step = 0.5; step > 0.005; ) {
        const { f_n, zeta, misfit } = found;
        for (const [i, j] of [[step, 0], [-step, 0], [0, step], [0, -step]]) {
          const mode = fitted(f_n * Math.exp(i), zeta * Math.exp(j), dead_time, T_s, x_d, x, n);
          if (mode.misfit < found.misfit) found = mode;
        }
        if (found.misfit === misfit) step /= 2;
      }
      if (found.misfit < best.misfit) best = found;
    }
    await pause();
  }
  return best;
}

/** Predictions by physics model and hybrid, of the C library, each window before it is learned: two (n,) arrays. */
async function hybrid(mode, Np, p, T_s, x_d, x, progress) {
  const module = Uint8Array.from(atob(MODULE), (c) => c.charCodeAt(0)), n = x.length;
  const library = (await WebAssembly.instantiate(module)).instance.exports;
  library._initialize();
  const room = library.room(4 * n), places = [0, 1, 2, 3].map((i) => room + 8 * i * n);
  const refused = library.begin(Np, p, mode.dead_time, T_s, mode.f_n, mode.zeta, mode.beta, x_d[0]);
  if (refused) {
    const text = new Uint8Array(library.memory.buffer, refused), name = text.subarray(0, text.indexOf(0));
    const what = new TextDecoder().decode(name);
    throw new LogError(`${what} is out of its range: T_s = ${T_s} s, Np = ${Np}, p = ${p}, which must be ≤ Np`);
  }
  const view = (i) => new Float64Array(library.memory.buffer, places[i], n);
  view(0).set(x_d);
  view(1).set(x);
  for (let k = 0; k < n + Np; k += 1000) {
    if (!library.play(k, Math.min(k + 1000, n + Np), n, Np, ...places))
      throw new LogError(`the prediction diverges before row ${k + 1000}; try a smaller p`);
    progress(k / n);
    await pause();
  }
  return [view(2).slice(), view(3).slice()];
}

/** Add a row to a triangular factor by Givens rotations; the row is spent. */
function rotate(R, row) {
  for (let i = 0; i < R.length; i++) {
    if (row[i] === 0) continue;
    const r = Math.hypot(R[i][i], row[i]), c = R[i][i] / r, s = row[i] / r;
    for (let j = i; j < R.length; j++) [R[i][j], row[j]] = [c * R[i][j] + s * row[j], c * row[j] - s * R[i][j]];
  }
}

/** Coefficients of least squares; where n rows leave them open, a penalty of their rounding's size takes the least. */
function solution(R, n) {
  const m = R.length - 1, w = new Float64Array(m), factor = R.map((row) => row.slice());
  const small = 2.3e-16 * n * Math.max(...R.map((row, i) => Math.abs(row[i])));
  for (let i = 0; i < m; i++) rotate(factor, Float64Array.from(factor, (_, j) => (j === i ? small : 0)));
  for (let i = m - 1; i >= 0; i--) {
    w[i] = factor[i][m];
    for (let j = i + 1; j < m; j++) w[i] -= factor[i][j] * w[j];
    w[i] /= factor[i][i];
  }
  return w;
}

/** y(k) = Σ a_i y(k−i) + Σ b_j [x_d(k−j) − x_d(k−j−1)] + c, y = x − x_d: predictions from row first on, NaN before. */
async function arx(lags, Np, first, x_d, x, progress) {
  const n = x.length, m = 2 * lags + 2, y = x.map((one, k) => one - x_d[k]), run = y.slice();
  const predicted = new Float64Array(n).fill(NaN), R = Array.from({ length: m + 1 }, () => new Float64Array(m + 1));
  const far = FAR * x.reduce((most, one, k) => Math.max(most, Math.abs(one - x_d[0]), Math.abs(x_d[k] - x_d[0])), 0);
  const row = (past, k) => {
    const found = new Float64Array(m + 1);
    for (let i = 1; i <= lags; i++) found[i - 1] = past[k - i];
    for (let j = 0; j <= lags; j++) found[lags + j] = x_d[k - j] - x_d[k - j - 1];
    found[m - 1] = 1;
    return found;
  };
  for (let begin = 0; begin < n; begin += Np) {
    const end = Math.min(begin + Np, n);
    if (begin >= first) { // a free run over the window
      const w = solution(R, begin);
      for (let k = begin; k < end; k++) {
        const known = row(run, k);
        run[k] = w.reduce((sum, one, i) => sum + one * known[i], 0);
        if (!(Math.abs(run[k]) <= far)) return predicted.fill(NaN);
        predicted[k] = x_d[k] + run[k];
      }
      run.set(y.subarray(begin, end), begin);
    }
    for (let k = Math.max(begin, lags + 1); k < end; k++) {
      const known = row(y, k);
      known[m] = y[k];
      rotate(R, known);
    }
    progress(begin / n);
    if (begin / Np % 10 === 0) await pause();
  }
  return predicted;
}

/** The mode, the first row that is scored, and the predictions by name. */
async function predict({ x_d, x, T_s, Np, p }, say) {
  const n = x.length, first = Math.floor(n / 2 / Np) * Np, last = (k) => k - k % Np - 1;
  if (n < 10 * Np || first <= 2 * ARX_LAGS.at(-1))
    throw new LogError(`${n} rows are too few: ten windows of Np = ${Np} are needed, and 200; lower Np`);
  if (x_d.subarray(0, first).every((one) => one === x_d[0])) throw new LogError("no command moves in the first half");
  say("physics model", 0);
  const mode = await identify(T_s, x_d, x, first);
  const [x_pb, x_h] = await hybrid(mode, Np, p, T_s, x_d, x, (done) => say("hybrid", done));
  const hold = x_pb.map((one, k) => (k < Np ? one : one + x[last(k)] - x_pb[last(k)]));
  const predictions = { "physics model": x_pb, hold };
  for (const lags of ARX_LAGS)
    predictions[`ARX${lags}`] = await arx(lags, Np, first, x_d, x, (done) => say(`ARX${lags}`, done));
  return { mode, first, predictions: { ...predictions, hybrid: x_h } };
}

/** RMS and largest error over rows; NaN where nothing is predicted. */
function score(x, predicted, begin, end) {
  const errors = x.slice(begin, end).map((one, i) => Math.abs(one - predicted[begin + i]));
  const squares = errors.reduce((sum, e) => sum + e * e, 0), max = errors.reduce((a, b) => Math.max(a, b));
  return { rms: Math.sqrt(squares / errors.length), max };
}

/** Errors of the windows on a logarithmic axis, as SVG. */
function plot({ x, Np, first, predictions, unit: [, unit, factor] }, what) {
  const n = Math.ceil(x.length / Np), names = Object.keys(predictions), lines = names.map((name) =>
    Array.from({ length: n }, (_, i) => factor * score(x, predictions[name], i * Np, (i + 1) * Np)[what]));
  const high = lines.flat().reduce((a, b) => (b > a ? b : a), 1e-9), shown = lines.flat().filter((e) => e >= high / 1e3);
  const low = shown.reduce((a, b) => Math.min(a, b)); // an error of 0 makes no axis of 15 decades
  const X = (i) => (60 + 830 * i / n).toFixed(1), half = X(first / Np);
  const Y = (e) => (280 - 270 * Math.log(Math.max(e, low) / low) / Math.log(high / low)).toFixed(1);
  let svg = `<path d="M${half} 10V280"/><text x="${half}" y="300" text-anchor="middle">scored from here</text>` +
    `<text x="60" y="300">window 1</text><text x="890" y="300" text-anchor="end">${n}</text>` +
    `<text transform="translate(14 145) rotate(-90)" text-anchor="middle">${unit}</text>`;
  for (let decade = Math.floor(Math.log10(low)); decade <= Math.log10(high); decade++)
    for (const tick of [1, 2, 5].map((one) => Number(`${one}e${decade}`)).filter((one) => one >= low && one <= high))
      svg += `<path d="M60 ${Y(tick)}H890"/><text x="52" y="${Y(tick)}" dy="4" text-anchor="end">${tick}</text>`;
  lines.forEach((e, j) => {
    const points = e.map((one, i) => (one >= 0 ? `${X(i + 0.5)},${Y(one)} ` : ""));
    svg += `<polyline points="${points.join("")}" stroke="${COLOURS[names[j]]}"/>`;
  });
  at("plot").innerHTML = svg;
}

let log, shown, runs = 0;

function tell(error, status = "") {
  [at("error").textContent, at("status").textContent] = [error, status];
  at("result").hidden = !shown;
}

async function run() {
  const turn = ++runs, begun = performance.now(), value = (id) => Number(at(id).value), t = at("t").value;
  const say = (what, done) => {
    if (turn !== runs) throw new LogError("another run has begun");
    tell("", `${what} … ${Math.round(100 * done)} %`);
  };
  shown = null;
  try {
    if (!at("form").checkValidity()) throw new LogError("choose commanded and measured position, and their unit");
    const chosen = { x_d: value("x_d"), x: value("x"), t, T_s: 1e-3 * value("T_s"), unit: at("unit").value };
    const given = { ...samples(log, chosen), Np: value("Np"), p: value("p") }, found = await predict(given, say);
    shown = { ...given, ...found };
    show((performance.now() - begun) / 1e3);
  } catch (error) {
    if (turn === runs) tell(error instanceof LogError ? error.message : `the page fails: ${error}`);
  }
}

function show(seconds) {
  const { x, first, predictions, unit, mode, Np, T_s } = shown, names = Object.keys(predictions);
  const scores = names.map((name) => score(x, predictions[name], first, x.length));
  const best = scores.reduce((a, b) => (b.rms < a.rms ? b : a));
  const cell = (e) => `<td>${isNaN(e) ? "diverges" : `${digits(unit[2] * e)} ${unit[1]}`}</td>`;
  at("rows").innerHTML = scores.map((one, i) => `<tr${one === best ? ' class="best"' : ""}><td>` +
    `<i style="background:${COLOURS[names[i]]}"></i>${names[i]}</td>${cell(one.rms)}${cell(one.max)}</tr>`).join("");
  const [f_n, zeta, span] = [mode.f_n, mode.zeta, 1e3 * Np * T_s].map(digits);
  at("model").textContent = `a mode of ${f_n} Hz, damping ${zeta}, with a zero, ${mode.dead_time} samples of dead time`;
  const scored = Math.ceil((x.length - first) / Np), windows = `${scored} windows of ${Np} samples, ${span} ms`;
  tell("", `${x.length} rows, scored by ${windows}; computed in ${seconds.toFixed(1)} s`);
  plot(shown, at("what").value);
}

async function open(file) {
  shown = null;
  try {
    log = parse(await file.text());
  } catch (error) {
    return tell(`${file.name}: ${error.message}`);
  }
  for (const [role, known] of Object.entries(NAMES)) {
    const place = known.split(" ").map((name) => log.names.findIndex((one) => plain(one) === name)).find((j) => j >= 0);
    const none = role === "t" ? [new Option("none", "")] : [];
    at(role).replaceChildren(...none, ...log.names.map((name, j) => new Option(name, j)));
    at(role).value = place ?? "";
  }
  const units = ["x_d", "x"].map((id) => (at(id).value === "" ? "" : unit_of(log, at(id).value)));
  at("unit").value = spelled(units[0] || units[1]);
  at("form").hidden = false;
  return run();
}

function drop(event, over) {
  event.preventDefault();
  at("drop").className = over;
}

at("unit").replaceChildren(...Object.keys(UNITS).map((name) => new Option(name)));
at("file").onchange = (event) => event.target.files[0] && open(event.target.files[0]);
at("form").onsubmit = (event) => { event.preventDefault(); run(); };
at("what").onchange = () => plot(shown, at("what").value);
document.ondragover = (event) => drop(event, "over");
document.ondragleave = (event) => drop(event, "");
document.ondrop = (event) => {
  drop(event, "");
  if (event.dataTransfer.files[0]) open(event.dataTransfer.files[0]);
};
