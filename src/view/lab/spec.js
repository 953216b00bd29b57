// The state of the laboratory, and its form in a link.

const levels = ["first", "student", "all"];
const speedChoices = [1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2, 1, 2, 4];
const mostLinks = 300; // view/lab.hpp has this bound, and those of stateOf, too
const listed = 4; // links whose numbers have sliders of their own

/// Parameters of a model, from `pendula describe`, link by link.
const modelParameters = (model?.parameters ?? []).flatMap((each) => {
  const count = each.per_link ? model.links : 1;
  return Array.from({ length: count }, (_, k) => ({ ...each, label: () => parameterWords(each, k) }));
});

/// The label of a parameter: words for built-in models, else the name in the model's file.
function parameterWords({ name, per_link }, k) {
  const key = `parameter.${name}`;
  const words = models[named] && key in texts.en ? text(key) : name;
  return per_link ? `${words} ${k + 1}` : words;
}

const pointColumns = (model?.points ?? []).reduce((sum, each) => sum + each.columns.length, 0);

const freshState = () => ({
  n: 2, space: 2, m: [1, 1], l: [1, 1], g: 9.81, d: 0, t: 0,
  q: model ? (moved.start?.q ?? model.coordinates.map((_, k) => (k === model.coordinates.length - 1 ? 1 : 0.1))) : [2.0943951023931953, 2.6179938779914944],
  v: model ? (moved.start?.v ?? model.coordinates.map(() => 0)) : [0, 0],
  p: modelParameters.map((each) => moved.start?.p?.[each.name] ?? each.default ?? 1),
  u: model ? model.inputs.map(() => 0) : [0, 0], // constant parts of inputs; torques of a chain, link by link
  s: [], // sines on them: [input, amplitude, frequency, phase]
  speed: 1, level: "student", lang: "", theme: "", copies: 0, apart: 1e-6,
  show: ["trace"],
});

/// A number, or the same for each of n, from "1,2,3"; "30deg" is an angle.
function numbersOf(words, n) {
  const numbers = words.split(",").map((word) => (word.endsWith("deg") ? (parseFloat(word) * Math.PI) / 180 : Number(word)));
  if (!numbers.every(Number.isFinite)) return null;
  return Array.from({ length: n }, (_, k) => numbers[Math.min(k, numbers.length - 1)]);
}

/// Sines on inputs, from four numbers each; null if they make no sense.
function sinesOf(words, inputs) {
  const numbers = words.split(",").map(Number);
  if (numbers.length % 4 !== 0 || !numbers.every(Number.isFinite)) return null;
  const sines = Array.from({ length: numbers.length / 4 }, (_, k) => numbers.slice(4 * k, 4 * k + 4));
  return sines.every(([input]) => Number.isInteger(input) && input >= 0 && input < inputs) ? sines : null;
}

/// The sines with an amplitude that is not 0.
function actingSines(state) {
  return state.s.filter(([, amplitude]) => amplitude !== 0);
}

/// Whether inputs change the energy.
function isDriven(state) {
  return state.u.some((each) => each !== 0) || actingSines(state).length > 0;
}

/// The state of a link; missing or wrong parts have their defaults.
function stateOf(words) {
  const state = freshState();
  const told = new URLSearchParams(words);
  const number = (key, low, high) => {
    const x = Number(told.get(key) ?? NaN);
    if (told.has(key) && Number.isFinite(x)) state[key] = clamp(x, low, high);
  };
  number("t", -1e9, 1e9), number("n", 1, mostLinks), number("space", 2, 3), number("g", -100, 100), number("d", 0, 1000);
  number("speed", 1 / 128, 8), number("copies", 0, 200), number("apart", 1e-14, 0.1);
  state.n = Math.round(state.n), state.space = Math.round(state.space), state.copies = Math.round(state.copies);
  const size = model ? model.coordinates.length : state.n;
  resize(state);
  const list = (key, n, good = () => true) => {
    const found = told.has(key) ? numbersOf(told.get(key), n) : null;
    return found && found.every(good) ? found : null;
  };
  const positive = (x) => x > 0 && x < 1e6;
  state.u = list("u", state.u.length) ?? state.u;
  state.s = sinesOf(told.get("s") ?? "", state.u.length) ?? state.s;
  state.m = list("m", state.n, positive) ?? state.m;
  state.l = list("l", state.n, positive) ?? state.l;
  if (model) {
    state.p = list("p", modelParameters.length) ?? state.p;
    state.q = list("q", size) ?? state.q, state.v = list("v", size) ?? state.v;
  } else {
    const part = (key, others) => list(key, state.n) ?? others;
    const [q, v] = [state.q, state.v];
    state.q = part("th", q.slice(0, state.n)), state.v = part("w", v.slice(0, state.n));
    if (state.space === 3) {
      state.q = state.q.concat(part("ph", q.slice(state.n))), state.v = state.v.concat(part("wp", v.slice(state.n)));
    }
  }
  if (levels.includes(told.get("level"))) state.level = told.get("level");
  if (texts[told.get("lang")]) state.lang = told.get("lang");
  if (["light", "dark"].includes(told.get("theme"))) state.theme = told.get("theme");
  if (told.has("show")) state.show = told.get("show").split(" ").filter(Boolean);
  return state;
}

/// Adapts all lists of a chain to its number of links; links keep their angles.
function resize(state) {
  if (model) return;
  const { n, space } = state;
  const grown = (list, count, fresh) => Array.from({ length: count }, (_, k) => list[k] ?? fresh(k));
  const before = state.m.length;
  const [theta, phi] = [state.q.slice(0, before), state.q.slice(before)];
  const [turn, around] = [state.v.slice(0, before), state.v.slice(before)];
  state.m = grown(state.m, n, () => state.m.at(-1));
  // Long chains get the total length of short ones, so that they stay on the stage.
  const length = state.l.reduce((sum, each) => sum + each, 0);
  if (n !== before && (n > listed || before > listed)) state.l = Array.from({ length: n }, () => Number((length / n).toPrecision(4)));
  else state.l = grown(state.l, n, () => state.l.at(-1));
  // Torques in the plane are not those in space.
  const torques = space === 2 ? 1 : 3;
  const isAlike = state.u.length === torques * before;
  state.u = grown(isAlike ? state.u : [], torques * n, () => 0);
  state.s = isAlike ? state.s.filter(([input]) => input < state.u.length) : [];
  state.q = grown(theta, n, () => theta.at(-1));
  state.v = grown(turn, n, () => 0);
  if (space === 3) {
    state.q = state.q.concat(grown(phi, n, (k) => 0.3 * Math.min(k, 5)));
    state.v = state.v.concat(grown(around, n, () => (phi.length ? 0 : 0.6)));
  }
}

/// The words of the link to a state.
function linkOf(state) {
  const words = [];
  const fresh = freshState();
  const short = (numbers) => (numbers.every((x) => x === numbers[0]) ? `${numbers[0]}` : numbers.join(","));
  const put = (key, value) => words.push(`${key}=${value}`);
  if (models[named] || named === "chain") put("model", named);
  if (linkChoices.length > 1) put("n", model.links);
  if (state.t) put("t", state.t);
  if (state.u.some((each) => each !== 0)) put("u", short(state.u));
  if (actingSines(state).length) put("s", actingSines(state).flat().join(","));
  if (model) {
    put("p", state.p.join(",")), put("q", state.q.join(",")), put("v", short(state.v));
  } else {
    const { n } = state;
    put("n", n), put("space", state.space), put("m", short(state.m)), put("l", short(state.l)), put("g", state.g), put("d", state.d);
    put("th", short(state.q.slice(0, n))), put("w", short(state.v.slice(0, n)));
    if (state.space === 3) put("ph", short(state.q.slice(n))), put("wp", short(state.v.slice(n)));
  }
  for (const key of ["speed", "level", "lang", "theme", "copies", "apart"]) {
    if (state[key] !== fresh[key]) put(key, state[key]);
  }
  if (state.show.join() !== fresh.show.join()) put("show", state.show.join("+"));
  return words.join("&");
}

/// The description of a state's system for the engine.
function specOf(state) {
  const acting = { inputs: state.u, sines: actingSines(state) };
  if (model) {
    const [components, connections] = [model.points.map(({ columns }) => columns.length), model.connections.filter(({ kind }) => kind !== "pulleys").map(({ ends }) => ends)];
    return { program: moved.program, parameters: state.p, components, connections, ...acting };
  }
  return { space: state.space, masses: state.m, lengths: state.l, gravity: state.g, damping: state.m.map(() => state.d), ...acting };
}

/// Names of the coordinates.
function coordinatesOf({ n, space }) {
  if (model) return model.coordinates.map((each) => each.name);
  const names = Array.from({ length: n }, (_, k) => `theta_${k + 1}`);
  return space === 2 ? names : names.concat(names.map((name) => name.replace("theta", "phi")));
}

/// The scale of energies: Σ M g l of a chain, as in the program's summaries; otherwise the energies themselves.
function energyScaleOf({ m, l, g, n }, kinetic, potential) {
  let [below, sum] = [0, 0];
  for (let k = n - 1; k >= 0 && !model; --k) sum += (below += m[k]) * Math.abs(g) * l[k];
  return sum || [Math.abs(kinetic), Math.abs(potential)].filter((each) => each > 1e-12).sort((a, b) => b - a)[0] || 1;
}
