// Sliders and buttons.

/// A slider with a number beside it: {key, unit, low, high, step, get, set, level, logarithmic}. `names` are put into its
/// text; `label` returns its text, in place of a key.
class Slider {
  constructor({ key, names = {}, unit, low, high, step, get, set, level = "", logarithmic = false, label }) {
    Object.assign(this, { get, set, logarithmic, low, high, step });
    this.name = element("span");
    this.number = element("input", { type: "number", step: "any" });
    this.range = element("input", { type: "range", min: 0, max: 1, step: "any" });
    this.words = label ?? (() => text(key, names));
    const value = element("span", { className: "value" }, this.number, element("i", { textContent: unit }));
    this.node = element("label", { className: `slider ${level}` }, this.name, value, this.range);
    this.range.addEventListener("input", () => this.#change(this.#of(Number(this.range.value))));
    this.number.addEventListener("change", () => {
      const typed = Number(this.number.value.replace("−", "-"));
      if (this.number.value !== "" && Number.isFinite(typed) && (!this.logarithmic || typed > 0)) this.#change(typed);
      this.#write(this.get()); // the value that was accepted
    });
    // Without this, arrow keys on a slider without steps would be too fine or too coarse.
    this.range.addEventListener("keydown", (event) => {
      const way = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
      if (!way) return;
      event.preventDefault();
      event.stopPropagation();
      this.#change(this.logarithmic ? this.get() * 1.1 ** way : clamp(this.get() + way * step, low, high));
    });
    this.refresh();
  }

  #of(place) {
    const { low, high, step } = this;
    if (this.logarithmic) return Number((low * (high / low) ** place).toPrecision(2));
    return Math.round((low + place * (high - low)) / step) * step;
  }
  #placeOf(x) {
    const { low, high } = this;
    return clamp(this.logarithmic ? Math.log(x / low) / Math.log(high / low) : (x - low) / (high - low), 0, 1);
  }

  #change(x) {
    this.set(Number(x.toPrecision(12)));
    this.refresh();
  }

  refresh() {
    const x = this.get();
    this.name.textContent = this.words();
    const said = this.name.textContent;
    this.range.setAttribute("aria-label", said);
    this.number.setAttribute("aria-label", said);
    this.range.value = this.#placeOf(x);
    this.range.setAttribute("aria-valuetext", `${readable(x)}`);
    if (document.activeElement !== this.number) this.#write(x);
  }

  #write(x) {
    this.number.value = Number(x.toPrecision(5));
  }
}

/// kg m^2 as kg m², and nothing for a plain number.
function unitWords(unit) {
  return unit === "1" ? "" : unitText(unit).replace("^2", "²").replace("^3", "³");
}

/// The inputs of a chain: torques, link by link.
function torquesOf({ n, space }) {
  const axes = space === 2 ? [""] : ["x_", "y_", "z_"];
  return Array.from({ length: n }, (_, k) => axes.map((axis) => ({ name: `torque_${axis}${k + 1}`, unit: "N m" }))).flat();
}

/// All settings, for the present number of links.
class Controls {
  constructor(lab) {
    this.lab = lab;
    this.host = at("controls");
  }

  get #state() {
    return this.lab.state;
  }

  /// Makes the settings again, for another number of links.
  make() {
    this.sliders = [];
    this.host.replaceChildren();
    this.#makeMenu();
    if (model) this.#makeModel();
    else this.#makeChain();
    this.#makeDrives();
    this.#makeStart();
    this.refresh();
  }

  refresh() {
    for (const slider of this.sliders ?? []) slider.refresh();
    for (const each of this.host.querySelectorAll("[data-text]")) each.textContent = text(each.dataset.text);
    for (const each of this.menu?.options ?? []) each.textContent = each.value ? text(`model.${each.value}`) : beginning.title;
    this.menu?.setAttribute("aria-label", text("settings.moves"));
    for (const button of this.host.querySelectorAll("[data-space]")) {
      button.setAttribute("aria-pressed", Number(button.dataset.space) === this.#state.space);
    }
  }

  #title(key, level = "") {
    const heading = element("h2", { className: level });
    heading.dataset.text = key;
    this.host.append(heading);
  }

  #slider(what) {
    const slider = new Slider(what);
    this.sliders.push(slider);
    this.host.append(slider.node);
  }

  // The menu of systems; another one reloads the page.
  #makeMenu() {
    if (Object.keys(models).length === 0) return;
    const menu = element("select", { id: "model" });
    menu.dataset.label = "settings.moves";
    const add = (value) => menu.append(element("option", { value, selected: value === (named ?? (model ? "" : "chain")) }));
    add("chain");
    if (beginning.model && moved === beginning) add("");
    for (const name of Object.keys(models)) add(name);
    menu.addEventListener("change", () => this.lab.looks.go(menu.value));
    this.menu = menu;
    this.host.append(element("div", { className: "menu" }, menu));
  }

  #makeChain() {
    const { lab } = this;
    const state = () => this.#state;
    this.#title("settings.pendulum");
    const choice = element("div", { className: "choice student" });
    for (const [space, key] of [[2, "plane"], [3, "space"]]) {
      const button = element("button", { type: "button" });
      button.dataset.text = key;
      button.dataset.space = space;
      button.addEventListener("click", () => lab.setLinks(state().n, space));
      choice.append(button);
    }
    this.host.append(choice);
    this.#slider({
      key: "links", unit: "", low: 1, high: 10, step: 1, get: () => state().n, set: (n) => lab.setLinks(clamp(Math.round(n), 1, mostLinks), state().space),
    });
    this.#slider({ key: "gravity", unit: "m/s²", low: 0, high: 25, step: 0.01, get: () => state().g, set: (g) => lab.change({ g }) });
    this.#slider({ key: "damping", unit: "N m s", low: 0, high: 1, step: 0.005, level: "student", get: () => state().d, set: (d) => lab.change({ d: Math.max(d, 0) }) });
    this.#makeList("m", "masses", "mass", "kg", 0.05, 20);
    this.#makeList("l", "lengths", "length", "m", 0.05, 5);
  }

  #makeList(list, title, key, unit, low, high) {
    const { lab } = this;
    const { n } = this.#state;
    const set = (k, x) => {
      const numbers = this.#state[list].slice();
      if (k < 0) numbers.fill(x);
      else numbers[k] = x;
      lab.change({ [list]: numbers });
    };
    this.#title(title, "student");
    const many = n > listed;
    for (let k = 0; k < (many ? 1 : n); ++k) {
      this.#slider({
        key: many ? `${key}.all` : key, names: { k: k + 1 }, unit, low, high, level: "student", logarithmic: true,
        get: () => this.#state[list][k], set: (x) => x > 0 && set(many ? -1 : k, x),
      });
    }
  }

  #makeModel() {
    const { lab } = this;
    this.#title("settings.model");
    if (linkChoices.length > 1) {
      this.#slider({ key: "links", unit: "", low: 1, high: Math.max(...linkChoices), step: 1, get: () => model.links, set: (n) => linkChoices.includes(n) && n !== model.links && lab.looks.go(named, n) });
    }
    modelParameters.forEach((each, k) => {
      const now = this.#state.p[k] || each.default || 0;
      const size = Math.abs(now) || 1;
      this.#slider({
        label: each.label, unit: unitWords(each.unit), logarithmic: each.positive,
        low: each.positive ? size / 20 : Math.min(0, 2.5 * now), high: each.positive ? size * 20 : now > 0 ? 2.5 * now : 1, step: 0.01 * size,
        get: () => this.#state.p[k],
        set: (x) => {
          const p = this.#state.p.slice();
          p[k] = x;
          lab.change({ p });
        },
      });
    });
  }

  // Constant parts of inputs and sines on them: for each input of a model; for a chain the torque on its first rod, and those
  // in the link.
  #makeDrives() {
    const { lab } = this;
    const state = this.#state;
    const inputs = model?.inputs ?? torquesOf(state);
    const first = model ? inputs.map((_, k) => k) : [state.space === 2 ? 0 : 1];
    const isShown = (k) => first.includes(k) || state.u[k] !== 0 || state.s.some(([input]) => input === k);
    const shown = inputs.map((_, k) => k).filter(isShown);
    if (shown.length === 0) return;
    this.#title("settings.drive", "student");
    for (const k of shown) {
      const names = { input: symbol(inputs[k].name) };
      const unit = unitWords(inputs[k].unit);
      if (!state.s.some(([input]) => input === k)) state.s.push([k, 0, 3, 0]);
      const set = (sine, part, x) => {
        sine[part] = x;
        lab.change({ s: state.s });
      };
      for (const sine of state.s.filter(([input]) => input === k)) {
        const [, amplitude, frequency] = sine;
        const most = Math.max(2 * Math.abs(amplitude), 10);
        this.#slider({ key: "drive.amplitude", names, unit, low: 0, high: most, step: most / 200, level: "student", get: () => sine[1], set: (x) => set(sine, 1, x) });
        this.#slider({ key: "drive.frequency", names, unit: "rad/s", low: 0, high: Math.max(2 * frequency, 15), step: 0.05, level: "student", get: () => sine[2], set: (x) => set(sine, 2, x) });
        this.#slider({ key: "drive.phase", names, unit: "°", low: -180, high: 180, step: 1, level: "all", get: () => (sine[3] * 180) / Math.PI, set: (x) => set(sine, 3, (x * Math.PI) / 180) });
      }
      const most = Math.max(2 * Math.abs(state.u[k]), 10);
      this.#slider({
        key: "drive.held", names, unit, low: -most, high: most, step: most / 200, level: "all", get: () => this.#state.u[k],
        set: (x) => lab.change({ u: this.#state.u.map((each, i) => (i === k ? x : each)) }),
      });
    }
  }

  // The start; one slider for all angles of a long chain.
  #makeStart() {
    const { lab } = this;
    const { n, space } = this.#state;
    this.#title("settings.start");
    const set = (part, k, x) => {
      const numbers = Array.from(this.#state[part]);
      if (k < 0) for (let i = 0; i < n; ++i) numbers[i] = x;
      else numbers[k] = x;
      lab.startFrom({ [part]: numbers }, k);
    };
    const angle = (label, k, level = "") => this.#slider({
      label: () => label, unit: "°", low: -180, high: 180, step: 1, level,
      get: () => (this.#state.q[Math.max(k, 0)] * 180) / Math.PI, set: (x) => set("q", k, (x * Math.PI) / 180),
    });
    if (model) {
      lab.coordinates.forEach((name, k) => {
        if (lab.isAngle[k]) angle(symbol(name), k);
        else this.#slider({ label: () => symbol(name), unit: unitWords(lab.units[k]), low: -3, high: 3, step: 0.01, get: () => this.#state.q[k], set: (x) => set("q", k, x) });
      });
      return;
    }
    if (n > listed) angle("θ", -1);
    else for (let k = 0; k < n; ++k) angle(symbol(`theta_${k + 1}`), k);
    for (let k = 0; space === 3 && k < Math.min(n, listed); ++k) angle(symbol(`phi_${k + 1}`), n + k, "all");
    for (let k = 0; k < Math.min(n, listed); ++k) {
      this.#slider({
        label: () => `${symbol(`theta_${k + 1}`)} ′`, unit: "°/s", low: -720, high: 720, step: 1, level: "all",
        get: () => (this.#state.v[k] * 180) / Math.PI, set: (x) => set("v", k, (x * Math.PI) / 180),
      });
    }
  }
}
